//! Pictures as files: PNG of the lit picture, EXR of what was seen, in one direction or in all six.
//!
//! An EXR file has one part, and layers as the names of its channels tell them (`layer.channel`): viewers group those, and older
//! ones show no more than the first of several parts. It appears whole or not at all: it is written aside, synced and renamed.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, WritableImage,
};
use farfield_core::color::linear_of_byte;
use farfield_core::image::{Picture, SurfaceImage, from_octahedral};

use crate::measure::Rendered;

/// The layers of a panoramic sample, in the order of [`farfield_core::Camera::cube`].
pub const FACES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];

/// Writes a lit picture.
///
/// # Errors
/// What writing gives.
pub fn write_png(file: &Path, picture: &Picture) -> io::Result<()> {
    let bytes: Vec<u8> = picture.rgba.iter().flatten().copied().collect();
    let image = image::RgbaImage::from_raw(picture.size[0], picture.size[1], bytes)
        .ok_or_else(|| io::Error::other("the picture is not as large as it says"))?;
    image.save_with_format(file, image::ImageFormat::Png).map_err(io::Error::other)
}

/// Writes a frame as one EXR layer: R G B A (linear light of the lit picture, coverage), albedo.R G B (linear), normal.X Y Z, Z
/// (linear depth, scene units, infinite at the background) and object (number + 1, 0 at the background).
///
/// # Errors
/// What writing gives; nothing is left of the file then.
pub fn write_exr(file: &Path, frame: &Rendered) -> io::Result<()> {
    let s = &frame.surface;
    let lit = |k: usize| floats(s, |i| linear_of_byte(frame.picture.rgba[i][k]));
    let mut channels = vec![("A".to_owned(), coverage(s))];
    channels
        .extend([("Z", FlatSamples::F32(s.depth.clone())), ("object", FlatSamples::U32(s.object.clone()))].map(named));
    channels.extend([("R", lit(0)), ("G", lit(1)), ("B", lit(2))].map(named));
    let rest = [("albedo.R", albedo(s, 0)), ("albedo.G", albedo(s, 1)), ("albedo.B", albedo(s, 2))];
    channels.extend(rest.map(named));
    channels.extend([("normal.X", normal(s, 0)), ("normal.Y", normal(s, 1)), ("normal.Z", normal(s, 2))].map(named));
    write_channels(file, s.size, channels, None)
}

/// Writes a panoramic sample as six EXR layers, [`FACES`], each of R G B A (linear albedo, coverage), Z (linear depth along the
/// face's axis, scene units, infinite where nothing was hit), N.X N.Y N.Z (unit normal, 0 where nothing was hit) and id (object
/// number + 1 as a 32-bit integer, 0 where nothing was hit). `comments` goes into the header.
///
/// # Errors
/// What writing gives; nothing is left of the file then. Faces of different sizes are refused.
pub fn write_sample(file: &Path, faces: &[SurfaceImage; 6], comments: &str) -> io::Result<()> {
    let size = faces[0].size;
    if faces.iter().any(|f| f.size != size) {
        return Err(io::Error::other("the faces of a sample are of one size"));
    }
    let of_face = |(layer, s): (&&str, &SurfaceImage)| {
        let planes = [
            ("R", albedo(s, 0)),
            ("G", albedo(s, 1)),
            ("B", albedo(s, 2)),
            ("A", coverage(s)),
            ("Z", FlatSamples::F32(s.depth.clone())),
            ("N.X", normal(s, 0)),
            ("N.Y", normal(s, 1)),
            ("N.Z", normal(s, 2)),
            ("id", FlatSamples::U32(s.object.clone())),
        ];
        planes.map(|(name, values)| (format!("{layer}.{name}"), values))
    };
    write_channels(file, size, FACES.iter().zip(faces).flat_map(of_face).collect(), Some(comments))
}

fn named((name, values): (&str, FlatSamples)) -> (String, FlatSamples) {
    (name.to_owned(), values)
}

/// A plane of a value a pixel.
fn floats(s: &SurfaceImage, value: impl Fn(usize) -> f32) -> FlatSamples {
    FlatSamples::F32((0..s.object.len()).map(value).collect())
}

/// 1 where a surface was hit, 0 elsewhere.
fn coverage(s: &SurfaceImage) -> FlatSamples {
    floats(s, |i| if s.hit(i) { 1.0 } else { 0.0 })
}

/// Linear albedo: red, green or blue.
fn albedo(s: &SurfaceImage, k: usize) -> FlatSamples {
    floats(s, |i| linear_of_byte(s.albedo[i][k]))
}

/// The normal's coordinate `k`; 0 where nothing was hit.
fn normal(s: &SurfaceImage, k: usize) -> FlatSamples {
    floats(s, |i| if s.hit(i) { from_octahedral(s.normal[i])[k] } else { 0.0 })
}

/// Writes planes of one size as an EXR of one part.
fn write_channels(
    file: &Path,
    size: [u32; 2],
    channels: Vec<(String, FlatSamples)>,
    comments: Option<&str>,
) -> io::Result<()> {
    let pixels = size[0] as usize * size[1] as usize;
    if channels.iter().any(|(_, values)| values.len() != pixels) {
        return Err(io::Error::other("the picture is not as large as it says"));
    }
    let channels = channels.into_iter().map(|(name, values)| AnyChannel::new(name.as_str(), values));
    let layer = Layer::new(
        (size[0] as usize, size[1] as usize),
        LayerAttributes { comments: comments.map(Text::from), ..LayerAttributes::default() },
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    );
    let image = Image::from_layer(layer);
    whole(file, |aside| image.write().to_unbuffered(aside).map_err(io::Error::other))
}

/// A file that `write` writes: whole, or not there.
fn whole(file: &Path, write: impl FnOnce(&File) -> io::Result<()>) -> io::Result<()> {
    let name = file.file_name().ok_or_else(|| io::Error::other("this is no file's name"))?.to_string_lossy();
    let aside = file.with_file_name(format!(".{name}.{}", std::process::id()));
    let done = File::create(&aside).and_then(|f| write(&f).and_then(|()| f.sync_all()));
    let done = done.and_then(|()| fs::rename(&aside, file));
    if done.is_err() {
        _ = fs::remove_file(&aside);
    }
    done
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::image::{SurfaceImage, octahedral};
    use glam::Vec3;

    #[test]
    fn an_exr_holds_what_was_seen() {
        let size = [2, 1];
        let surface = SurfaceImage {
            size,
            albedo: vec![[255, 0, 0, 255], [0; 4]],
            normal: vec![octahedral(Vec3::Y), octahedral(Vec3::Y)],
            depth: vec![3.5, f32::INFINITY],
            object: vec![7, 0],
        };
        let frame = Rendered { picture: Picture { size, rgba: vec![[188, 188, 188, 255], [0, 0, 0, 255]] }, surface };
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("a.exr");
        write_exr(&file, &frame).unwrap();
        let back = exr::prelude::read_all_flat_layers_from_file(&file).unwrap();
        let channel = |name: &str| {
            let list = &back.layer_data[0].channel_data.list;
            list.iter().find(|c| c.name.to_string() == name).unwrap().sample_data.values_as_f32().collect::<Vec<f32>>()
        };
        assert_eq!(channel("Z"), [3.5, f32::INFINITY]);
        assert_eq!(channel("object"), [7.0, 0.0]);
        assert_eq!((channel("albedo.R")[0], channel("albedo.G")[0]), (1.0, 0.0));
        assert!((channel("normal.Y")[0] - 1.0).abs() < 1e-3 && channel("normal.Y")[1] == 0.0);
        assert!((channel("R")[0] - 0.5).abs() < 0.01);
    }

    /// A face of `size` that differs from others by its number, with a hole.
    fn face(number: u32, size: [u32; 2]) -> SurfaceImage {
        let n = size[0] * size[1];
        let all = (0..n).map(|i| (i, i % 3 != number % 3));
        let seen =
            |f: &dyn Fn(u32) -> f32| all.clone().map(|(i, hit)| if hit { f(i) } else { f32::INFINITY }).collect();
        SurfaceImage {
            size,
            albedo: all
                .clone()
                .map(|(i, hit)| if hit { [i as u8, 40 + number as u8, 255, 255] } else { [0; 4] })
                .collect(),
            normal: (0..n).map(|i| octahedral(Vec3::new(1.0, i as f32, number as f32))).collect(),
            depth: seen(&|i| (i + 1) as f32 * 0.3 + number as f32),
            object: all.clone().map(|(i, hit)| if hit { 16_777_217 + i + number } else { 0 }).collect(),
        }
    }

    #[test]
    fn a_samples_layers_hold_what_each_face_saw() {
        let faces: [SurfaceImage; 6] = std::array::from_fn(|k| face(k as u32, [5, 4]));
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("sample.exr");
        write_sample(&file, &faces, "from here").unwrap();
        let back = exr::prelude::read_all_flat_layers_from_file(&file).unwrap();
        assert_eq!(back.layer_data.len(), 1, "one part, for viewers that show only the first");
        assert_eq!(back.layer_data[0].attributes.comments.as_ref().unwrap().to_string(), "from here");
        let list = &back.layer_data[0].channel_data.list;
        assert_eq!(list.len(), 6 * 9);
        let plane = |name: String| &list.iter().find(|c| c.name.to_string() == name).unwrap().sample_data;
        let linear = |b: u8| {
            let v = f64::from(b) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let axes = [("+x", 0), ("-x", 1), ("+y", 2), ("-y", 3), ("+z", 4), ("-z", 5)];
        for (layer, k) in axes {
            let float = |name: &str| match plane(format!("{layer}.{name}")) {
                FlatSamples::F32(v) => v.clone(),
                other => panic!("{name}: {other:?}"),
            };
            assert_eq!(float("Z"), faces[k].depth);
            assert_eq!(plane(format!("{layer}.id")), &FlatSamples::U32(faces[k].object.clone()));
            let [r, g, b, a, x, y, z] = ["R", "G", "B", "A", "N.X", "N.Y", "N.Z"].map(float);
            for i in 0..20 {
                let hit = faces[k].depth[i].is_finite();
                assert_eq!(a[i], if hit { 1.0 } else { 0.0 });
                for (found, byte) in [r[i], g[i], b[i]].into_iter().zip(faces[k].albedo[i]) {
                    assert!((f64::from(found) - linear(byte)).abs() < 1e-6, "{layer} {i}: {found} of {byte}");
                }
                let expected = if hit { Vec3::new(1.0, i as f32, k as f32).normalize() } else { Vec3::ZERO };
                assert!(Vec3::new(x[i], y[i], z[i]).distance(expected) < 1e-4, "{layer} {i}");
            }
        }
    }

    #[test]
    fn what_cannot_be_written_leaves_nothing() {
        let faces: [SurfaceImage; 6] = std::array::from_fn(|k| face(k as u32, [2, 2]));
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("taken.exr")).unwrap();
        std::fs::write(dir.path().join("taken.exr/inside"), "kept").unwrap();
        assert!(write_sample(&dir.path().join("taken.exr"), &faces, "").is_err());
        assert!(write_sample(&dir.path().join("nowhere/a.exr"), &faces, "").is_err());
        let mut torn = faces.clone();
        torn[3].size = [4, 1];
        assert!(write_sample(&dir.path().join("b.exr"), &torn, "").is_err());
        torn[3] = SurfaceImage { size: [2, 2], ..SurfaceImage::default() };
        assert!(write_sample(&dir.path().join("c.exr"), &torn, "").is_err(), "planes shorter than their size");
        let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["taken.exr"]);
    }
}
