//! SPIR-V for backends that speak Vulkan themselves: naga with the options that wgpu-hal 30 gives it, so that both stacks run
//! the same instructions.
//!
//! No ADJUST_COORDINATE_SPACE: the backend uses a viewport of negative height, as wgpu-hal does.

use farfield_core::Fault;
use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};

use crate::{COMPUTE_ENTRY, FRAGMENT_ENTRY, Shader, VERTEX_ENTRY};

/// What the device promises of accesses out of range; decides which checks naga writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Robustness {
    /// `robustBufferAccess2` is enabled.
    pub buffer: bool,
    /// `robustImageAccess2`, or `robustImageAccess` where robustness2 does not exist, is enabled.
    pub image: bool,
}

/// A stage of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The vertex stage.
    Vertex,
    /// The fragment stage.
    Fragment,
    /// The compute stage.
    Compute,
}

/// The SPIR-V of one stage of a shader, as words; the entry point keeps its name. `version` is the SPIR-V version: (1, 3) for
/// Vulkan 1.1, (1, 5) for 1.2, (1, 6) for 1.3.
///
/// # Errors
/// [`Fault::Data`] with naga's message, where the source is wrong.
pub fn compile(shader: Shader, stage: Stage, version: (u8, u8), robust: Robustness) -> Result<Vec<u32>, Fault> {
    let source = shader.wgsl();
    let bad = |cause: String| Fault::Data { place: format!("the shader for {}", shader.label()), cause };
    let module = naga::front::wgsl::parse_str(source).map_err(|e| bad(e.emit_to_string(source)))?;
    // Of the shaders here Warp alone uses either; devices that lack them take WarpHalves.
    let wide = naga::valid::Capabilities::SHADER_INT64 | naga::valid::Capabilities::SHADER_INT64_ATOMIC_MIN_MAX;
    let info = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), wide)
        .validate(&module)
        .map_err(|e| bad(e.emit_to_string(source)))?;
    let checked = |robust| if robust { BoundsCheckPolicy::Unchecked } else { BoundsCheckPolicy::Restrict };
    let options = spv::Options {
        lang_version: version,
        flags: spv::WriterFlags::LABEL_VARYINGS | spv::WriterFlags::FORCE_POINT_SIZE,
        // Without a map, group g and binding b become set g and binding b.
        fake_missing_bindings: true,
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: checked(robust.buffer),
            image_load: checked(robust.image),
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        force_loop_bounding: true,
        ..Default::default()
    };
    let pipeline = spv::PipelineOptions {
        shader_stage: match stage {
            Stage::Vertex => naga::ShaderStage::Vertex,
            Stage::Fragment => naga::ShaderStage::Fragment,
            Stage::Compute => naga::ShaderStage::Compute,
        },
        entry_point: match stage {
            Stage::Vertex => VERTEX_ENTRY,
            Stage::Fragment => FRAGMENT_ENTRY,
            Stage::Compute => COMPUTE_ENTRY,
        }
        .into(),
    };
    spv::write_vec(&module, &info, &options, Some(&pipeline)).map_err(|e| bad(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_of_every_shader_compiles() {
        let robust = Robustness { buffer: true, image: true };
        for shader in Shader::ALL {
            for &stage in shader.stages() {
                let words = compile(shader, stage, (1, 3), robust).unwrap();
                assert_eq!(words[0], 0x0723_0203, "{shader:?}");
                assert_eq!(words[1], 0x0001_0300, "{shader:?}");
            }
        }
    }

    #[test]
    fn only_the_whole_warp_needs_wide_numbers() {
        // OpCapability (17, two words long) Int64 (11) or Int64Atomics (12).
        let wide = |shader: Shader, stage| {
            let words = compile(shader, stage, (1, 3), Robustness { buffer: true, image: true }).unwrap();
            words.windows(2).any(|w| w[0] == 2 << 16 | 17 && [11, 12].contains(&w[1]))
        };
        for shader in Shader::ALL {
            assert!(shader.stages().iter().all(|&s| wide(shader, s) == (shader == Shader::Warp)), "{shader:?}");
        }
    }

    #[test]
    fn checks_are_written_where_the_device_promises_nothing() {
        let of = |robust| compile(Shader::Chunk, Stage::Vertex, (1, 3), robust).unwrap().len();
        assert!(of(Robustness { buffer: false, image: false }) > of(Robustness { buffer: true, image: true }));
    }
}
