//! The eight kinds of statues: the table of the paper's scenes, and the mesh files that come nearest to the paper's models.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::fit::Up;

/// A kind of statue, in the order of the paper's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A coiled dragon.
    Dragon,
    /// A sitting rabbit.
    Bunny,
    /// A draped bust.
    Statue,
    /// A bull.
    Cattle,
    /// A rearing horse.
    Horse,
    /// A moai.
    Easter,
    /// A dromedary.
    Camel,
    /// A Venus without arms.
    Venus,
}

/// What the paper says of a kind.
struct Row {
    name: &'static str,
    triangles: u32,
    /// Width (x), depth (z), height (y).
    w_d_h: [f32; 3],
    /// How many stand in the 2M, 4M and 8M scenes.
    numbers: [u32; 3],
}

const TABLE: [Row; 8] = [
    Row { name: "dragon", triangles: 202_520, w_d_h: [57.3, 25.6, 40.4], numbers: [4, 10, 18] },
    Row { name: "bunny", triangles: 69_451, w_d_h: [43.6, 33.8, 43.2], numbers: [7, 12, 26] },
    Row { name: "statue", triangles: 35_280, w_d_h: [11.8, 13.4, 23.4], numbers: [13, 21, 40] },
    Row { name: "cattle", triangles: 12_398, w_d_h: [40.0, 40.8, 30.7], numbers: [9, 19, 42] },
    Row { name: "horse", triangles: 7_257, w_d_h: [38.3, 57.2, 82.6], numbers: [13, 29, 51] },
    Row { name: "easter", triangles: 4_976, w_d_h: [12.4, 10.7, 30.8], numbers: [6, 14, 22] },
    Row { name: "camel", triangles: 3_969, w_d_h: [49.4, 16.8, 46.6], numbers: [4, 14, 26] },
    Row { name: "venus", triangles: 1_396, w_d_h: [10.2, 8.4, 21.9], numbers: [8, 13, 28] },
];

impl Kind {
    /// All kinds, in the order of the paper's table.
    pub const ALL: [Kind; 8] =
        [Kind::Dragon, Kind::Bunny, Kind::Statue, Kind::Cattle, Kind::Horse, Kind::Easter, Kind::Camel, Kind::Venus];

    /// Its name in the paper's table.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Triangles of the paper's model.
    pub fn paper_triangles(self) -> u32 {
        self.row().triangles
    }

    /// Triangles of the sculpted stand-in: the paper's count, or one less where that is odd, because a closed mesh of
    /// triangles has an even number of them (3 T = 2 E).
    pub fn sculpted_triangles(self) -> u32 {
        self.row().triangles & !1
    }

    /// The paper's box in scene units: x (its width), y (its height), z (its depth).
    pub fn size(self) -> Vec3 {
        let [w, d, h] = self.row().w_d_h;
        Vec3::new(w, h, d)
    }

    /// How many stand in the paper's 2M, 4M and 8M scenes.
    pub fn paper_numbers(self) -> [u32; 3] {
        self.row().numbers
    }

    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }
}

/// A mesh file that stands in for one of the paper's models, and how it has to be turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperModel {
    /// The kind it is.
    pub kind: Kind,
    /// Path under the models folder.
    pub file: &'static str,
    /// The direction in the file that is up.
    pub up: Up,
    /// Turn about the vertical, degrees counter-clockwise seen from above, after `up` is up: brings the longer side where the
    /// paper's table has it.
    pub yaw_deg: f32,
    /// Triangles in the file; the paper's count where the file is the paper's model.
    pub triangles: u32,
}

/// The files that come nearest to the paper's models, one a kind, in the order of [`Kind::ALL`]; which way is up in each was read
/// off its box (the paper's proportions) and its picture. Dragon, bunny and Venus have
/// the paper's very counts; the others differ, and so do the totals of parks made of them.
pub const PAPER_MODELS: [PaperModel; 8] = [
    model(Kind::Dragon, "statuary/dragon_vrip_res2.ply.gz", Up::Y, 0.0, 202_520),
    model(Kind::Bunny, "statuary/bun_zipper.ply.gz", Up::Y, 0.0, 69_451),
    model(Kind::Statue, "statuary/BustManWreath.obj.gz", Up::Y, 0.0, 31_514),
    model(Kind::Cattle, "statuary/bull.obj.gz", Up::Y, 0.0, 12_396),
    model(Kind::Horse, "statuary/horse_glmark2.obj.gz", Up::MinusZ, 90.0, 7_172),
    model(Kind::Easter, "statuary/moaimoai.obj.gz", Up::Y, 0.0, 20_000),
    model(Kind::Camel, "statuary/camel_b.obj.gz", Up::Y, 90.0, 3_576),
    model(Kind::Venus, "statuary/venus.obj.gz", Up::Y, 0.0, 1_396),
];

const fn model(kind: Kind, file: &'static str, up: Up, yaw_deg: f32, triangles: u32) -> PaperModel {
    PaperModel { kind, file, up, yaw_deg, triangles }
}
