//! Whether an error that begins at a run is one that came with the warming of the machine.
//!
//! An error of the place that is not there in the cold runs and has one size in all warm ones reads like what a warm body does,
//! where the machine was warm by the first of them. With f the signature of the error, g that of an effect of heat at its usual size, and
//! f_r, g_r their readings of run r:
//!
//! ```text
//!   sum_r (f_r g_r)^2 / (g_r g_r) >= 0.8 |f|^2                            (1)
//!   mean |g_r| of the runs before <= half of the mean |g_r| from the first one on          (2)
//! ```
//!
//! (1): in each run the error has the form of the heat's, at whatever size. (2): the heat came where the error began.
//!
//! # Holds when
//! What warmed the machine, motion or a thermometer, was recorded, so that the effect of heat has a course. That course itself is not
//! compared: bodies warm faster or slower than any model of them, and a few warm runs may all be alike.

use nalgebra::DVector;

use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::signature::{Begins, Instance, Library, begin_s};

/// Effects of heat that read like an error of the place.
const OF_HEAT: [&str; 2] = ["screw_elongation", "workpiece_expansion"];
/// (1).
const MIN_SHARE: f64 = 0.8;
/// (2).
const MOST_BEFORE: f64 = 0.5;

/// Lists effects of heat with errors that begin where the machine was warm first.
pub(crate) fn list(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    let all = signatures.instances.iter();
    let heat: Vec<&Instance> = all
        .filter(|own| OF_HEAT.contains(&own.kind.id) && own.begins.is_none())
        .collect();
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let Some(begins) = instance.begins else {
            continue;
        };
        if member.status() == Status::Surrogate {
            continue;
        }
        let found = stack.signature(&*instance.effect(&member.estimate.values));
        for rival in &heat {
            let warm = stack.signature(&*rival.at_usual_size());
            if let Some(share) = share(stack, &found, &warm, begins) {
                let axis = rival.target.to_string();
                unresolved::list(member, rival.kind.id, &axis, share.sqrt());
            }
        }
    }
}

/// (1), where it and (2) hold.
fn share(
    stack: &Stack<'_>,
    found: &DVector<f64>,
    warm: &DVector<f64>,
    begins: Begins,
) -> Option<f64> {
    let mut explained = 0.0;
    let (mut before, mut after) = (Mean::default(), Mean::default());
    for (place, run) in stack.session.runs.iter().enumerate() {
        let (mut product, mut square) = (0.0, 0.0);
        let mut was_read = false;
        for block in stack.rows.blocks.iter().filter(|own| own.run == place) {
            was_read = true;
            let [f, g] = [found, warm].map(|all| all.rows(block.start, block.rows.len()));
            product += f.dot(&g);
            square += g.norm_squared();
        }
        if square > 0.0 {
            explained += product * product / square;
        }
        match begin_s(run) {
            Some(at_s) if was_read && at_s >= begins.at_s => after.add(square.sqrt()),
            Some(_) if was_read => before.add(square.sqrt()),
            _ => {}
        }
    }
    let share = explained / found.norm_squared().max(f64::MIN_POSITIVE);
    let came = before.value() <= MOST_BEFORE * after.value();
    (came && share >= MIN_SHARE).then_some(share)
}

#[derive(Default)]
struct Mean {
    sum: f64,
    n: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.n += 1.0;
    }

    fn value(&self) -> f64 {
        self.sum / self.n.max(1.0)
    }
}
