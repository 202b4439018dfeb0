//! Pictures as files: PNG of the lit picture, EXR of what was seen.

use std::io;
use std::path::Path;

use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
use farfield_core::color::linear_of_byte;
use farfield_core::image::{Picture, from_octahedral};

use crate::measure::Rendered;

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
/// What writing gives.
pub fn write_exr(file: &Path, frame: &Rendered) -> io::Result<()> {
    let s = &frame.surface;
    let channel = |name: &str, values: FlatSamples| AnyChannel::new(name, values);
    let floats = |f: &dyn Fn(usize) -> f32| FlatSamples::F32((0..s.object.len()).map(f).collect());
    let mut channels = vec![
        channel("A", floats(&|i| if s.hit(i) { 1.0 } else { 0.0 })),
        channel("Z", FlatSamples::F32(s.depth.clone())),
        channel("object", FlatSamples::U32(s.object.clone())),
    ];
    for (k, name) in ["R", "G", "B"].into_iter().enumerate() {
        channels.push(channel(name, floats(&|i| linear_of_byte(frame.picture.rgba[i][k]))));
        channels.push(channel(&format!("albedo.{name}"), floats(&|i| linear_of_byte(s.albedo[i][k]))));
    }
    for (k, name) in ["X", "Y", "Z"].into_iter().enumerate() {
        let normal = |i: usize| if s.hit(i) { from_octahedral(s.normal[i])[k] } else { 0.0 };
        channels.push(channel(&format!("normal.{name}"), floats(&normal)));
    }
    let size = (s.size[0] as usize, s.size[1] as usize);
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into_iter().collect()),
    );
    Image::from_layer(layer).write().to_file(file).map_err(io::Error::other)
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
}
