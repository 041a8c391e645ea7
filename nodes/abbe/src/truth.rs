//! The plant's truth as a scenario may read it: at poses of a verification, while the machine stands still.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use fake_cnc_node::Witness;
use metrology::PerAxis;
use metrology::stamp::{Host, Span, Stamp};
use reports::evidence::PoseError;

/// Rest after which the machine has settled at a pose of the verification.
const REST: Span = Span::from_nanos(400_000_000);

/// What the scenario and its witness share.
#[derive(Default)]
pub struct Truth {
    /// Whether a verification is under way.
    pub verifying: AtomicBool,
    seen: Mutex<Seen>,
}

#[derive(Default)]
struct Seen {
    poses: Vec<PoseError>,
    latency_s: Option<f64>,
}

impl Truth {
    /// Poses since the last call, and the plant's latency.
    pub fn take(&self) -> (Vec<PoseError>, Option<f64>) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        (std::mem::take(&mut seen.poses), seen.latency_s)
    }

    /// The look at the plant that belongs to this.
    pub fn witness(self: &Arc<Self>) -> Witness {
        let truth = Arc::clone(self);
        let mut at_rest: Option<(PerAxis<f64>, Stamp<Host>)> = None;
        let mut taken = false;
        let mut told = false;
        Box::new(move |at, cnc| {
            if !told {
                told = true;
                let mut seen = truth.seen.lock().unwrap_or_else(PoisonError::into_inner);
                seen.latency_s = Some(cnc.hardware().probe_latency_s());
            }
            if !truth.verifying.load(Ordering::Relaxed) {
                at_rest = None;
                return;
            }
            let commanded = cnc.commanded();
            match at_rest {
                Some((pose, since)) if pose == *commanded => {
                    if !taken && at - since >= REST {
                        taken = true;
                        let error_mm = cnc.hardware().tool_error_mm(commanded);
                        let commanded_mm = commanded.xyz();
                        let mut seen = truth.seen.lock().unwrap_or_else(PoisonError::into_inner);
                        seen.poses.push(PoseError {
                            commanded_mm,
                            error_mm,
                        });
                    }
                }
                _ => {
                    at_rest = Some((*commanded, at));
                    taken = false;
                }
            }
        })
    }
}
