//! A pipeline's cells, and those that the path needs. Nothing is built here.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use farfield_core::Camera;
use farfield_core::camera::ViewModel;
use farfield_core::context::{Context, Forget};
use farfield_core::id::CellId;
use farfield_core::scene::Scene;
use farfield_core::strategy::{Cells, LeftOut};

use super::{NoCapture, Pool};
use crate::config::{BuildWhen, Pipeline};
use crate::failure::Failure;

/// A pipeline's cells and the path through them.
#[derive(Clone)]
pub struct Division {
    /// All cells.
    pub cells: Arc<dyn Cells>,
    /// The cell of every frame.
    pub path: Vec<Option<CellId>>,
    /// The cells that the path visits, ascending.
    pub needed: Vec<CellId>,
}

/// Divides the viewpoints for a pipeline and finds each frame's cell.
///
/// # Errors
/// [`Failure::Input`] where the partition refuses scene or views.
pub fn divide(
    pipeline: &Pipeline,
    scene: &Scene,
    views: &ViewModel,
    cameras: &[Camera],
    cancel: &AtomicBool,
) -> Result<Division, Failure> {
    let cx = Context { capture: &NoCapture, run: &Pool, memo: &Forget, cancel };
    let refused = |f| Failure::before(format!("pipeline \"{}\": its partition", pipeline.name), f);
    let cells: Arc<dyn Cells> = pipeline.partition.divide(scene, views, &cx).map_err(refused)?.into();
    let path: Vec<Option<CellId>> = cameras.iter().map(|c| cells.find(c)).collect();
    let mut needed: Vec<CellId> = path.iter().flatten().copied().collect();
    needed.sort_unstable();
    needed.dedup();
    Ok(Division { cells, path, needed })
}

impl Division {
    /// The cells that are not built, and frames outside all cells, in words.
    pub fn left_out(&self) -> Vec<LeftOut> {
        let (all, needed) = (self.cells.outlines().len(), self.needed.len());
        let plan = |stage: &str, reason: String| LeftOut { stage: stage.into(), reason, decided: "plan".into() };
        let mut out = vec![];
        if needed < all {
            out.push(plan("other cells", format!("the path visits {needed} of {all} cells")));
        }
        let outside = self.path.iter().filter(|c| c.is_none()).count();
        if outside > 0 {
            let reason =
                format!("{outside} of {} frames are in no cell: plain geometry is drawn there", self.path.len());
            out.push(plan("far field outside cells", reason));
        }
        out
    }
}

impl BuildWhen {
    /// What is not built ahead of the walk.
    pub(crate) fn left_out(self, division: &Division) -> Option<LeftOut> {
        let reason = || format!("{} visited cells are built on demand, when they are wanted", division.needed.len());
        (self == Self::OnDemand).then(|| LeftOut {
            stage: "building ahead".into(),
            reason: reason(),
            decided: "plan".into(),
        })
    }
}
