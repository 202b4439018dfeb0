//! The executor and the captures that bakes get from the harness.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::JoinHandle;

use farfield_core::Fault;
use farfield_core::backend::{Backend, upload_scene};
use farfield_core::context::{Capture, Executor, Shot};
use farfield_core::image::SurfaceImage;
use farfield_core::scene::Scene;
use farfield_cpu::CpuCapture;
use farfield_vulkan::VulkanBackend;
use farfield_wgpu::WgpuBackend;
use rayon::prelude::*;

use crate::config::BackendName;

/// Raised whenever captures of the GPU backends change: part of every store key.
const GPU_VERSION: u32 = 1;

/// Jobs on the threads of the pool that the caller is in.
pub struct Pool;

impl Executor for Pool {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        let failed = AtomicBool::new(false);
        let one = |i: usize| {
            if failed.load(Ordering::Relaxed) {
                return None;
            }
            let fault = job(i).err()?;
            failed.store(true, Ordering::Relaxed);
            Some((i, fault))
        };
        match (0..n).into_par_iter().filter_map(one).min_by_key(|f| f.0) {
            Some((_, fault)) => Err(fault),
            None => Ok(()),
        }
    }
}

/// Takes no pictures: for stages that need none.
pub struct NoCapture;

impl Capture for NoCapture {
    fn identity(&self) -> &str {
        "none"
    }

    fn shoot(&self, _shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        Err(Fault::Refused("this stage was not to take pictures".into()))
    }
}

/// The captures that `[build]` names.
///
/// # Errors
/// What opening the device and uploading the scene gives.
pub fn capture(name: BackendName, scene: &Arc<Scene>) -> Result<Box<dyn Capture>, Fault> {
    match name {
        BackendName::Cpu => Ok(Box::new(CpuCapture::new(scene)?)),
        BackendName::Wgpu => GpuCapture::start(
            scene.clone(),
            |s| WgpuBackend::new(s, &farfield_wgpu::Options::default()),
            WgpuBackend::capture,
        ),
        BackendName::Vulkan => GpuCapture::start(
            scene.clone(),
            |s| VulkanBackend::new(s, farfield_vulkan::Options::default()),
            VulkanBackend::capture,
        ),
    }
}

struct Order {
    shots: Vec<Shot>,
    reply: mpsc::Sender<Result<Vec<SurfaceImage>, Fault>>,
}

/// A device on a thread of its own, which bakes on all threads send their shots to. (A lock around the device would do
/// too, but for jobs that a waiting thread takes up while it holds one.)
struct GpuCapture {
    identity: String,
    orders: Mutex<Option<mpsc::Sender<Order>>>,
    thread: Option<JoinHandle<()>>,
}

impl GpuCapture {
    fn start<B: Backend + 'static>(
        scene: Arc<Scene>,
        open: fn(&Scene) -> Result<B, Fault>,
        shoot: fn(&mut B, &[Shot]) -> Result<Vec<SurfaceImage>, Fault>,
    ) -> Result<Box<dyn Capture>, Fault> {
        let (orders, inbox) = mpsc::channel::<Order>();
        let (opened, is_open) = mpsc::channel();
        let thread = std::thread::spawn(move || {
            let ready = open(&scene).and_then(|mut b| upload_scene(&mut b, &scene).map(|_| b));
            let mut backend = match ready {
                Ok(b) => {
                    let i = b.info();
                    _ = opened.send(Ok(format!("{} capture, version {GPU_VERSION}, {}", i.backend, i.device)));
                    b
                }
                Err(fault) => {
                    _ = opened.send(Err(fault));
                    return;
                }
            };
            for order in inbox {
                // A bake that has stopped waiting does not want its pictures.
                _ = order.reply.send(shoot(&mut backend, &order.shots));
            }
        });
        let identity = is_open.recv().map_err(|_| gone())??;
        Ok(Box::new(Self { identity, orders: Mutex::new(Some(orders)), thread: Some(thread) }))
    }
}

fn gone() -> Fault {
    Fault::Device { device: "capture".into(), cause: "its thread has ended".into() }
}

impl Capture for GpuCapture {
    fn identity(&self) -> &str {
        &self.identity
    }

    fn shoot(&self, shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        let (reply, answer) = mpsc::channel();
        let orders = self.orders.lock().unwrap_or_else(PoisonError::into_inner).clone().ok_or_else(gone)?;
        orders.send(Order { shots: shots.to_vec(), reply }).map_err(|_| gone())?;
        answer.recv().map_err(|_| gone())?
    }
}

impl Drop for GpuCapture {
    fn drop(&mut self) {
        *self.orders.lock().unwrap_or_else(PoisonError::into_inner) = None;
        if let Some(t) = self.thread.take() {
            _ = t.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pool_runs_every_job_and_tells_of_a_failure() {
        let done: Vec<AtomicBool> = (0..100).map(|_| AtomicBool::new(false)).collect();
        Pool.each(100, &|i| {
            done[i].store(true, Ordering::Relaxed);
            Ok(())
        })
        .unwrap();
        assert!(done.iter().all(|d| d.load(Ordering::Relaxed)));
        let fault = Pool.each(100, &|i| if i == 40 { Err(Fault::Refused("forty".into())) } else { Ok(()) });
        assert_eq!(fault.unwrap_err().to_string(), "forty");
    }
}
