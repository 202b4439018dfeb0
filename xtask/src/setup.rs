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

/// A C++ compiler: the tests and benchmarks build meshoptimizer, which farfield is compared with.
pub(crate) fn compiler() {
    if !has("c++") && !has("g++") && !has("clang++") {
        install("There is no C++ compiler", &["g++"], "the tests will not build");
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

fn install(what: &str, packages: &[&str], otherwise: &str) {
    let names = packages.join(" ");
    if !has("apt-get") {
        println!("{what}, and this is no Debian or Ubuntu: {otherwise}. It would need: {names}");
        return;
    }
    let root = Command::new("id").arg("-u").output().is_ok_and(|o| o.stdout == b"0\n");
    let prefix: &[&str] = match (root, has("sudo")) {
        (true, _) => &[],
        (false, true) => &["sudo", "--non-interactive"],
        (false, false) => {
            println!("{what}: {otherwise}. To install it: apt-get install {names}");
            return;
        }
    };
    println!("{what}: installing {names} with apt-get");
    let apt = |args: &[&str]| {
        let line: Vec<&str> = prefix.iter().chain(&["apt-get"]).chain(args).copied().collect();
        let done = Command::new(line[0])
            .args(&line[1..])
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .status();
        done.is_ok_and(|s| s.success())
    };
    let mut args = vec!["install", "-y", "--no-install-recommends"];
    args.extend(packages);
    if !(apt(&["update", "-qq"]) && apt(&args)) {
        println!("That failed: {otherwise}. To install it: sudo apt-get install {names}");
    }
}
