//! Installs what software rendering needs, on Debian and Ubuntu, after saying so; elsewhere it says what is missing.

use std::path::Path;
use std::process::{Command, Stdio};

/// Whether a program is on the path.
pub(crate) fn has(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|d| d.join(program).is_file())
}

/// A Vulkan driver: any manifest that a loader would find.
pub(crate) fn driver() {
    let folders = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];
    let found = folders.iter().any(|d| Path::new(d).read_dir().is_ok_and(|mut entries| entries.next().is_some()));
    if !found && std::env::var_os("VK_DRIVER_FILES").is_none() {
        install("There is no Vulkan driver", &["mesa-vulkan-drivers", "libvulkan1"], "the cpu backend will be used");
    }
}

/// A C++ compiler: meshoptimizer is built, with which `cluster-lod` simplifies and which edge collapse is compared with.
pub(crate) fn compiler() {
    if !has("c++") && std::env::var_os("CXX").is_none() {
        install("There is no C++ compiler", &["g++"], "farfield will not build");
    }
}

/// The validation layer.
pub(crate) fn validation() {
    let folders = ["/usr/share/vulkan/explicit_layer.d", "/etc/vulkan/explicit_layer.d"];
    let found = folders.iter().any(|d| Path::new(d).join("VkLayer_khronos_validation.json").is_file());
    if !found {
        install("The Vulkan validation layer is missing", &["vulkan-validationlayers"], "its tests will be skipped");
    }
}

/// Mesa asks for a display through a folder that a login makes, and complains several times where there was no login (in
/// containers, over ssh); the folder of temporary files holds no display either, and keeps it quiet.
pub(crate) fn without_display(command: &mut Command) -> &mut Command {
    match std::env::var_os("XDG_RUNTIME_DIR") {
        Some(_) => command,
        None => command.env("XDG_RUNTIME_DIR", std::env::temp_dir()),
    }
}

/// What may be done about missing packages.
#[derive(Debug, PartialEq)]
enum Way {
    /// Run apt-get behind these words.
    Install(&'static [&'static str]),
    /// Nothing but to say this.
    Say(String),
}

fn way(what: &str, names: &str, otherwise: &str, apt: bool, root: bool, sudo: bool) -> Way {
    match (apt, root, sudo) {
        (false, ..) => {
            Way::Say(format!("{what}, and this is no Debian or Ubuntu: {otherwise}. It would need: {names}"))
        }
        (true, true, _) => Way::Install(&[]),
        (true, false, true) => Way::Install(&["sudo", "--non-interactive"]),
        (true, false, false) => {
            Way::Say(format!("{what}: {otherwise}. To install it, as root: apt-get install {names}"))
        }
    }
}

fn install(what: &str, packages: &[&str], otherwise: &str) {
    let names = packages.join(" ");
    let root = Command::new("id").arg("-u").output().is_ok_and(|o| o.stdout == b"0\n");
    let prefix = match way(what, &names, otherwise, has("apt-get"), root, has("sudo")) {
        Way::Say(words) => return println!("{words}"),
        Way::Install(prefix) => prefix,
    };
    println!("{what}: installing {names} with apt-get");
    let apt = |args: &[&str]| {
        let line: Vec<&str> = prefix.iter().chain(&["apt-get"]).chain(args).copied().collect();
        let done = Command::new(line[0])
            .args(&line[1..])
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdin(Stdio::null())
            .output()
            .map_err(|e| e.to_string())?;
        // What it says of a package that went well is of no use to who wants to see a picture.
        if done.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&done.stderr).into_owned()) }
    };
    let mut args = vec!["install", "-y", "--no-install-recommends"];
    args.extend(packages);
    if let Err(said) = apt(&["update", "-qq"]).and_then(|()| apt(&args)) {
        println!("{}\nThat failed: {otherwise}. To install it, as root: apt-get install {names}", said.trim_end());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_installs_as_root_or_with_sudo_and_else_says_what_to_install() {
        let way = |apt, root, sudo| way("There is no A", "a b", "c is used", apt, root, sudo);
        assert_eq!(way(true, true, false), Way::Install(&[]));
        assert_eq!(way(true, false, true), Way::Install(&["sudo", "--non-interactive"]));
        let Way::Say(words) = way(true, false, false) else { panic!("it installs without the right to") };
        assert_eq!(words, "There is no A: c is used. To install it, as root: apt-get install a b");
        let Way::Say(words) = way(false, true, true) else { panic!("it installs without apt-get") };
        assert_eq!(words, "There is no A, and this is no Debian or Ubuntu: c is used. It would need: a b");
    }
}
