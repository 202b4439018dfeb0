//! Wavefront MTL: `newmtl`, `Kd`, `map_Kd`; the rest of the shading model is not used. A library that is missing or has
//! wrong lines gives warnings, never an error: the shape is there without it.

use std::path::{Path, PathBuf};

use farfield_core::color::linear_of_srgb;
use farfield_core::scene::Material;

use super::texture::Textures;
use super::{bytes, plain};

/// The materials of the libraries that an OBJ's `mtllib` names: one name with spaces, or several.
pub(super) fn read_library(
    obj: &Path,
    names: &str,
    textures: &mut Textures,
    warnings: &mut Vec<String>,
) -> Vec<(String, Material)> {
    let folder = obj.parent().unwrap_or(Path::new(""));
    let whole = resolve(folder, names);
    let files =
        if whole.is_file() { vec![whole] } else { names.split_whitespace().map(|n| resolve(folder, n)).collect() };
    let mut out = vec![];
    for file in files {
        textures.beside.insert(file.clone());
        match bytes::read(&file) {
            Ok(data) => out.extend(read(&file, &bytes::text(&data), textures, warnings)),
            Err(e) => warnings.push(format!("material library {e}")),
        }
    }
    out
}

/// A name as a file writes it, with either slash, beside that file.
pub(super) fn resolve(folder: &Path, name: &str) -> PathBuf {
    folder.join(name.replace('\\', "/"))
}

fn read(file: &Path, text: &str, textures: &mut Textures, warnings: &mut Vec<String>) -> Vec<(String, Material)> {
    let mut out: Vec<(String, Material)> = vec![];
    for (i, line) in text.lines().enumerate() {
        let (word, rest) = line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
        let rest = rest.trim();
        let at = format!("{}: line {}", file.display(), i + 1);
        if word == "newmtl" {
            out.push((rest.to_owned(), plain(rest)));
            continue;
        }
        let Some((_, m)) = out.last_mut() else { continue };
        match word {
            "Kd" => {
                let v: Vec<f32> = rest.split_whitespace().map_while(|w| w.parse().ok()).take(3).collect();
                // One number stands for all three (specification, "Kd r g b": "if only r is specified, then g and b are assumed equal").
                let rgb = match *v {
                    [v] => [v; 3],
                    [r, g, b] => [r, g, b],
                    _ => {
                        warnings.push(format!("{at}: \"{}\" is not a colour: grey is taken", bytes::excerpt(rest, 40)));
                        continue;
                    }
                };
                if m.texture.is_none() && rgb.iter().all(|v| v.is_finite()) {
                    let [r, g, b] = rgb.map(|v| linear_of_srgb(v.clamp(0.0, 1.0)));
                    m.base_color = [r, g, b, 1.0];
                }
            }
            "map_Kd" | "map_kd" => match textures.file(file.parent().unwrap_or(Path::new("")), file_of(rest)) {
                Ok(id) => {
                    m.texture = Some(id);
                    m.base_color = [1.0; 4];
                }
                Err(cause) => warnings.push(format!("{at}: {cause}: the plain colour is taken")),
            },
            _ => {}
        }
    }
    out
}

/// The file name behind the options of a `map_` statement (`-o u v w`, `-s u v w`, `-clamp on`, ...).
fn file_of(rest: &str) -> &str {
    let mut rest = rest;
    while rest.starts_with('-') {
        let (option, mut after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        let most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            _ => 1,
        };
        for k in 0..most {
            let (word, further) =
                after.trim_start().split_once(char::is_whitespace).unwrap_or((after.trim_start(), ""));
            // -o, -s and -t take one to three numbers.
            if k > 0 && word.parse::<f32>().is_err() {
                break;
            }
            after = further;
        }
        if after.len() >= rest.len() {
            break;
        }
        rest = after.trim_start();
    }
    rest.trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_before_a_texture_are_skipped() {
        for (line, file) in [
            ("a b.png", "a b.png"),
            ("-s 1 1 1 a.png", "a.png"),
            ("-o 0.5 a.png", "a.png"),
            ("-clamp on -mm 0 1 x/a.png", "x/a.png"),
            ("-s", ""),
        ] {
            assert_eq!(file_of(line), file, "{line}");
        }
    }

    #[test]
    fn broken_lines_are_warnings() {
        let mut warnings = vec![];
        let m = read(
            Path::new("a.mtl"),
            "Kd 1\nnewmtl a b\nKd 0.5\nnewmtl c\nKd red\nmap_Kd\nnewmtl d\nKd 1 nan 1",
            &mut Textures::default(),
            &mut warnings,
        );
        assert_eq!(m.iter().map(|m| m.0.as_str()).collect::<Vec<_>>(), ["a b", "c", "d"]);
        assert!((m[0].1.base_color[0] - 0.21404114).abs() < 1e-6);
        assert_eq!(m[1].1.base_color, Material::default().base_color);
        assert_eq!(m[2].1.base_color, Material::default().base_color);
        assert!(warnings[0].contains("a.mtl: line 5: \"red\""), "{warnings:?}");
        assert!(warnings[1].contains("a.mtl: line 6: "), "{warnings:?}");
    }
}
