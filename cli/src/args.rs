//! What the command line takes.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use farfield_experiments::config::{BackendName, Generated};

use clap::{Parser, Subcommand};

/// Experiments with far-field rendering.
#[derive(Debug, Parser)]
#[command(version, about)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Threads of all parallel work; without it one a core.
    #[arg(long, global = true)]
    pub(crate) threads: Option<usize>,
    /// No progress bars.
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
}

/// An experiment file with its overrides.
#[derive(Debug, clap::Args)]
pub(crate) struct Input {
    /// The experiment file (TOML).
    pub(crate) file: PathBuf,
    /// Overrides a setting: `view.frames=8`, `hybrid.far_field.edge_px=3`. May be given several times.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub(crate) sets: Vec<String>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Every registered strategy and backend, its settings with defaults, units and source.
    List {
        /// As JSON.
        #[arg(long)]
        json: bool,
        /// As the book's reference page.
        #[arg(long, conflicts_with = "json")]
        markdown: bool,
    },
    /// Validates an experiment and prints it resolved.
    Check {
        #[command(flatten)]
        input: Input,
    },
    /// What will be built and what is left out, with reasons and estimated sizes.
    Plan {
        #[command(flatten)]
        input: Input,
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
    /// Preprocessing only; resumable.
    Build {
        #[command(flatten)]
        input: Input,
        /// Where what is built is kept.
        #[arg(long, default_value = "store")]
        store: PathBuf,
    },
    /// Builds what is missing, walks the path, measures, writes results and a report.
    Run {
        #[command(flatten)]
        input: Input,
        /// Where results go; without it `out/` and the experiment's name.
        #[arg(long)]
        out: Option<PathBuf>,
        /// Where what is built is kept.
        #[arg(long, default_value = "store")]
        store: PathBuf,
    },
    /// One frame of one pipeline, as PNG or, with its layers, as EXR.
    Render {
        #[command(flatten)]
        input: Input,
        /// The pipeline's name, with swept values as `list`ed by `check`.
        #[arg(long)]
        pipeline: String,
        /// The frame's number.
        #[arg(long)]
        frame: usize,
        /// The picture: .png or .exr.
        #[arg(long)]
        out: PathBuf,
        /// Where what is built is kept.
        #[arg(long, default_value = "store")]
        store: PathBuf,
    },
    /// Panoramic samples as EXR files: six faces, each with albedo, depth, normal and object number.
    Sample {
        #[command(flatten)]
        input: Input,
        /// Where in the world: one sample of all geometry.
        #[arg(
            long,
            value_name = "X,Y,Z",
            allow_hyphen_values = true,
            value_parser = place,
            conflicts_with = "pipeline",
            required_unless_present = "pipeline"
        )]
        at: Option<Place>,
        /// The samples that this pipeline's far field was built from.
        #[arg(long)]
        pipeline: Option<String>,
        /// In this cell; without it in that of the path's first camera.
        #[arg(long, requires = "pipeline", conflicts_with = "at")]
        cell: Option<u32>,
        /// Side of a face, pixels.
        #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=4096))]
        face_px: u32,
        /// The file, .exr; of a pipeline the folder of its files.
        #[arg(long)]
        out: PathBuf,
        /// Where what is built is kept.
        #[arg(long, default_value = "store", conflicts_with = "at")]
        store: PathBuf,
    },
    /// Joins runs into one table and one plot of error against time.
    Compare {
        /// Folders that `run` wrote.
        #[arg(required = true)]
        runs: Vec<PathBuf>,
        /// The joined report.
        #[arg(long, default_value = "compare.html")]
        out: PathBuf,
    },
    /// What a small point and a small line cost in triangles, on each backend that there is: the setting `point_cost`.
    Calibrate {
        /// This backend alone.
        #[arg(long, value_parser = PossibleValuesParser::new(BackendName::ALL.map(BackendName::name)).try_map(backend))]
        backend: Option<BackendName>,
    },
    /// Generates a scene as .glb, .obj or .ply.
    Scene {
        /// What to generate.
        #[arg(value_parser = PossibleValuesParser::new(Generated::ALL.map(Generated::name)).map(named))]
        kind: Generated,
        /// Triangles in all; without it 262,879 of a house, 2,017,700 of a park, 1,000,000 of pipes, of a plant and of an asteroid.
        #[arg(long)]
        triangles: Option<u64>,
        /// Seed.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// The file.
        #[arg(long)]
        out: PathBuf,
    },
}

fn backend(name: String) -> Result<BackendName, String> {
    BackendName::ALL.into_iter().find(|b| b.name() == name).ok_or(name)
}

/// A place in the world, scene units.
pub(crate) type Place = [f64; 3];

/// Three finite numbers with commas between them.
fn place(text: &str) -> Result<Place, String> {
    let numbers: Vec<f64> =
        text.split(',').filter_map(|n| n.trim().parse().ok()).filter(|n: &f64| n.is_finite()).collect();
    let three = numbers.try_into().ok().filter(|_| text.split(',').count() == 3);
    three.ok_or_else(|| "a place is three numbers, as in 1.5,2,-3".to_owned())
}

/// The generator of that name; names that are not there have been refused before.
fn named(name: String) -> Generated {
    Generated::ALL.into_iter().find(|g| g.name() == name).unwrap_or(Generated::Park)
}
