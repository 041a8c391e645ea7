//! Effects of the two axes of a plane that a ballbar in this plane alone cannot separate.
//!
//! # Model
//!
//! Of a circle whose centre and radius float, what stretches one axis reads like what shortens the other:
//!
//! ```text
//!   r = (a_u cos^2 + a_v sin^2) R = (a_u + a_v) R/2 + (a_u - a_v) R/2 cos 2 theta      (1)
//! ```
//!
//! So a scale, and a lag of an axis behind its command, is listed with that of the other axis where the signatures have
//!
//! ```text
//!   |cos| >= 0.99                                                         (2)
//! ```
//!
//! # Holds when
//! Nothing but radii in one plane was read.

use metrology::Axis;
use twin::Channel;
use twin::effects::Target;
use twin::simulate::plate_axes;

use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::signature::{Instance, Library};

/// Effects that act along one axis, in the plane as (1).
const ALONG_AN_AXIS: [&str; 2] = ["scale_error", "servo_lag"];
/// (2).
const MIN_COSINE: f64 = 0.99;

/// Lists effects of one axis with those of the other axis of the plane.
pub(crate) fn list(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    let Some(axes) = sole_plane(stack) else {
        return;
    };
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let Target::Axis(axis) = instance.target else {
            continue;
        };
        let Some(other) = other_of(axes, axis) else {
            continue;
        };
        if member.status() == Status::Surrogate || !ALONG_AN_AXIS.contains(&instance.kind.id) {
            continue;
        }
        let [own, rival] = [axis, other].map(|axis| {
            let target = Target::Axis(axis);
            let plain = Instance {
                target,
                begins: None,
                ..instance.clone()
            };
            stack.signature(&*plain.at_usual_size())
        });
        let cos = own.dot(&rival).abs() / (own.norm() * rival.norm()).max(f64::MIN_POSITIVE);
        if cos >= MIN_COSINE {
            unresolved::list(member, instance.kind.id, &other.to_string(), cos);
        }
    }
}

/// The axes of the one plane in which radii alone were read.
fn sole_plane(stack: &Stack<'_>) -> Option<[Axis; 2]> {
    let mut planes = { stack.rows.blocks.iter() }.map(|block| {
        let plane = stack.session.runs[block.run].segment.plane;
        (block.channel == Channel::Radial).then(|| plate_axes(plane))?
    });
    let first = planes.next()??;
    planes.all(|plane| plane == Some(first)).then_some(first)
}

fn other_of([u, v]: [Axis; 2], axis: Axis) -> Option<Axis> {
    match axis {
        own if own == u => Some(v),
        own if own == v => Some(u),
        _ => None,
    }
}
