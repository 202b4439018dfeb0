//! What passes write: surface targets and pictures, kept by target and size.

use std::collections::HashMap;

use farfield_core::Fault;
use farfield_core::id::TargetId;

use crate::device::Gpu;
use crate::pipelines::{DEPTH, PICTURE, PLANES, Pipelines};

/// How many sizes of one target are kept: a frame has one or two, and a burst of odd sizes must not fill the memory.
const SIZES_KEPT: usize = 3;

pub(crate) struct Surface {
    /// Albedo, normal, depth, object.
    pub(crate) planes: [wgpu::Texture; 4],
    pub(crate) views: [wgpu::TextureView; 4],
    pub(crate) depth: wgpu::TextureView,
    /// The planes as a shading pass reads them.
    pub(crate) bind: wgpu::BindGroup,
}

pub(crate) struct Shaded {
    pub(crate) texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
}

/// Targets of one kind.
pub(crate) struct Kept<T> {
    all: HashMap<(TargetId, [u32; 2]), (u64, T)>,
    clock: u64,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self { all: HashMap::new(), clock: 0 }
    }
}

impl<T> Kept<T> {
    /// The target, made where it is not there; of each target the few sizes used last are kept.
    pub(crate) fn make(
        &mut self,
        id: TargetId,
        size: [u32; 2],
        make: impl FnOnce() -> Result<T, Fault>,
    ) -> Result<(), Fault> {
        self.clock += 1;
        if let Some((used, _)) = self.all.get_mut(&(id, size)) {
            *used = self.clock;
            return Ok(());
        }
        let of_id: Vec<(u64, [u32; 2])> =
            self.all.iter().filter(|((t, _), _)| *t == id).map(|((_, s), (used, _))| (*used, *s)).collect();
        if of_id.len() >= SIZES_KEPT
            && let Some((_, oldest)) = of_id.into_iter().min()
        {
            self.all.remove(&(id, oldest));
        }
        self.all.insert((id, size), (self.clock, make()?));
        Ok(())
    }

    pub(crate) fn get(&self, id: TargetId, size: [u32; 2]) -> Option<&T> {
        self.all.get(&(id, size)).map(|(_, t)| t)
    }
}

fn texture(gpu: &Gpu, size: [u32; 2], format: wgpu::TextureFormat, usage: wgpu::TextureUsages) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

impl Surface {
    pub(crate) fn new(gpu: &Gpu, pipelines: &Pipelines, size: [u32; 2]) -> Result<Self, Fault> {
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let planes = PLANES.map(|format| texture(gpu, size, format, usage));
        let views = [0, 1, 2, 3].map(|i: usize| planes[i].create_view(&wgpu::TextureViewDescriptor::default()));
        let depth = texture(gpu, size, DEPTH, wgpu::TextureUsages::empty());
        let depth = depth.create_view(&wgpu::TextureViewDescriptor::default());
        let entries = [0, 1, 2, 3].map(|i: usize| wgpu::BindGroupEntry {
            binding: i as u32,
            resource: wgpu::BindingResource::TextureView(&views[i]),
        });
        let bind = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("planes"),
            layout: &pipelines.planes,
            entries: &entries,
        });
        gpu.check()?;
        Ok(Self { planes, views, depth, bind })
    }
}

impl Shaded {
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, Fault> {
        let texture = texture(gpu, size, PICTURE, wgpu::TextureUsages::COPY_SRC);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        gpu.check()?;
        Ok(Self { texture, view })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_each_target_the_sizes_used_last_are_kept() {
        let mut kept: Kept<u32> = Kept::default();
        let other = TargetId(1);
        kept.make(other, [9, 9], || Ok(99)).unwrap();
        for i in 1..=3 {
            kept.make(TargetId(0), [i, i], || Ok(i)).unwrap();
        }
        // Used again, so that it outlives the next one.
        kept.make(TargetId(0), [1, 1], || panic!("it is there")).unwrap();
        kept.make(TargetId(0), [4, 4], || Ok(4)).unwrap();
        let there: Vec<u32> = (1..=4).filter(|&i| kept.get(TargetId(0), [i, i]).is_some()).collect();
        assert_eq!(there, [1, 3, 4]);
        assert_eq!(kept.get(other, [9, 9]), Some(&99));
    }

    #[test]
    fn a_target_that_cannot_be_made_is_not_kept() {
        let mut kept: Kept<u32> = Kept::default();
        assert!(kept.make(TargetId(0), [1, 1], || Err(Fault::Cancelled)).is_err());
        assert_eq!(kept.get(TargetId(0), [1, 1]), None);
    }
}
