//! Which classes a shift can show, how they are hidden, and what is true of each.
//!
//! Forms are the foreign ones of [`crate::effect`]. What heats the machine acts from its start in the morning on, behind the
//! day before and its night; half of the drifts are the air of the shop over the day.

use metrology::Axis;

use crate::effect::{Class, Hidden};
use crate::error::TrialError;
use crate::rig::Rig;
use crate::shop::{Name, name};

/// Classes that blocks and circles of a shift show.
pub(super) const CLASSES: [Class; 17] = [
    Class::Backlash,
    Class::ScaleError,
    Class::Squareness,
    Class::PitchError,
    Class::Straightness,
    Class::AngularError,
    Class::CyclicError,
    Class::ServoLag,
    Class::ReversalSpike,
    Class::ClockOffset,
    Class::ScrewElongation,
    Class::DriveWindup,
    Class::PlateError,
    Class::ClockDrift,
    Class::SpindleGrowth,
    Class::ColumnBend,
    Class::AmbientDrift,
];

/// Power that warms a machine's bed about as much as air that is 1 K warmer, W.
const W_PER_K: f64 = 400.0;

/// Whether planes of circles show a class on an axis; heat is shown by blocks.
pub(super) fn is_shown(class: Class, axis: &str, planes: &[[Axis; 2]]) -> bool {
    let mut letters: Vec<&str> = vec![];
    let own = match class {
        Class::SpindleGrowth
        | Class::ColumnBend
        | Class::AmbientDrift
        | Class::PlateError
        | Class::ClockOffset
        | Class::ClockDrift
        | Class::ScrewElongation => "",
        // The turn's own letter names no linear axis.
        Class::AngularError => axis.get(1..).unwrap_or(""),
        _ => axis,
    };
    letters.extend(own.split("").filter(|letter| !letter.is_empty()));
    planes.iter().any(|plane| {
        let has = |letter: &&str| plane.iter().any(|axis| axis.letter() == *letter);
        letters.iter().all(has)
    })
}

/// Hides an effect in a machine that works for a shift.
pub(super) fn hide(hidden: &Hidden, rig: &mut Rig) -> Result<(), TrialError> {
    if hidden.class == Class::AmbientDrift && hidden.shape[0] >= 0.5 {
        let air = &mut rig.plant.heat.shop_air;
        air.day_amplitude_k += hidden.size / W_PER_K;
        air.day_phase_deg = 360.0 * hidden.shape[1];
        return Ok(());
    }
    hidden.hide(rig)
}

/// In the words of a shop.
pub(super) const fn words(hidden: &Hidden) -> &'static str {
    match hidden.class {
        Class::Backlash => "lost motion",
        Class::ScaleError => "scale",
        Class::Squareness => "squareness",
        Class::PitchError => "lead error",
        Class::Straightness => "straightness",
        Class::AngularError => "angular error",
        Class::CyclicError => "cyclic error",
        Class::ServoLag => "servo lag",
        Class::ReversalSpike => "reversal spike",
        Class::ClockOffset => "late stamps",
        Class::ScrewElongation => "a screw that grows",
        Class::DriveWindup => "a soft screw",
        Class::PlateError => "scale of the plate",
        Class::ClockDrift => "a fast clock",
        Class::SpindleGrowth => "a spindle that grows",
        Class::ColumnBend => "a column that bends",
        Class::AmbientDrift => "air and hydraulics",
        _ => hidden.class.id(),
    }
}

/// Names of the catalogue that are true of an effect, and those that may be there as well.
pub(super) fn names(hidden: &Hidden) -> [Vec<Name>; 2] {
    let own = name(hidden.class.id(), hidden.axis);
    let drifts = || ["X", "Y", "Z"].map(|axis| name("ambient_drift", axis));
    match hidden.class {
        Class::SpindleGrowth => [
            vec![own, name("spindle_growth", "spindle_rear")],
            vec![name("column_bend", "")],
        ],
        Class::ColumnBend => [vec![own], drifts().to_vec()],
        Class::AmbientDrift => [
            drifts().to_vec(),
            vec![name("column_bend", ""), name("workpiece_expansion", "")],
        ],
        _ => {
            let besides = hidden.besides().map(|id| name(id, hidden.axis));
            [vec![own], besides.into_iter().collect()]
        }
    }
}

/// Others of the plant that may make the same readings.
pub(super) fn rivals(hidden: &Hidden) -> Vec<(Class, &'static str)> {
    let axis = hidden.axis;
    let neighbour = |axis: &str| match axis {
        "X" => "Y",
        _ => "X",
    };
    match hidden.class {
        Class::Backlash => vec![(Class::ReversalSpike, axis)],
        Class::ReversalSpike => vec![(Class::Backlash, axis)],
        Class::ScaleError => vec![
            (Class::PlateError, ""),
            (Class::ScaleError, neighbour(axis)),
            (Class::PitchError, axis),
        ],
        Class::PlateError => vec![(Class::ScaleError, "X"), (Class::ScaleError, "Y")],
        Class::Squareness => of_pair(axis),
        Class::Straightness => match axis {
            "XY" | "YX" => vec![(Class::Squareness, "XY"), (Class::AngularError, turn(axis))],
            "XZ" | "ZX" => vec![(Class::Squareness, "XZ"), (Class::AngularError, turn(axis))],
            _ => vec![(Class::Squareness, "YZ"), (Class::AngularError, turn(axis))],
        },
        Class::AngularError => sideways(axis),
        Class::PitchError => vec![(Class::ScaleError, axis), (Class::CyclicError, axis)],
        Class::CyclicError => vec![(Class::PitchError, axis)],
        Class::ServoLag => vec![
            (Class::ClockOffset, "grid"),
            (Class::ServoLag, neighbour(axis)),
        ],
        Class::ClockOffset => vec![(Class::ServoLag, "X"), (Class::ClockDrift, "grid")],
        Class::ClockDrift => vec![(Class::ClockOffset, "grid")],
        Class::ScrewElongation => vec![(Class::ScaleError, axis), (Class::AmbientDrift, "Y")],
        Class::SpindleGrowth => vec![(Class::ColumnBend, ""), (Class::AmbientDrift, "Y")],
        Class::ColumnBend => vec![(Class::AmbientDrift, "Y"), (Class::SpindleGrowth, "")],
        Class::AmbientDrift => vec![(Class::ColumnBend, ""), (Class::SpindleGrowth, "")],
        _ => vec![],
    }
}

/// Straightness of both axes of a pair.
fn of_pair(pair: &str) -> Vec<(Class, &'static str)> {
    let [one, other] = match pair {
        "XY" => ["XY", "YX"],
        "XZ" => ["XZ", "ZX"],
        _ => ["YZ", "ZY"],
    };
    vec![(Class::Straightness, one), (Class::Straightness, other)]
}

/// The turn of the moving axis, the last letter, that shifts a tool beside it along the first one.
fn turn(straightness: &str) -> &'static str {
    match straightness {
        "YX" => "CX",
        "ZX" => "BX",
        "XY" => "CY",
        "ZY" => "AY",
        "XZ" => "BZ",
        _ => "AZ",
    }
}

/// What a turn of an axis is to a tool beside it.
fn sideways(turn: &str) -> Vec<(Class, &'static str)> {
    let [one, other] = match turn {
        "AX" => ["YX", "ZX"],
        "BX" => return vec![(Class::Straightness, "ZX"), (Class::PitchError, "X")],
        "CX" => return vec![(Class::Straightness, "YX"), (Class::PitchError, "X")],
        "BY" => ["XY", "ZY"],
        "AY" => return vec![(Class::Straightness, "ZY"), (Class::PitchError, "Y")],
        "CY" => return vec![(Class::Straightness, "XY"), (Class::PitchError, "Y")],
        "AZ" => return vec![(Class::Straightness, "YZ"), (Class::PitchError, "Z")],
        _ => return vec![(Class::Straightness, "XZ"), (Class::PitchError, "Z")],
    };
    vec![(Class::Straightness, one), (Class::Straightness, other)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_planes_do_not_show_is_not_hidden() {
        let xy = [[Axis::X, Axis::Y]];
        assert!(is_shown(Class::Backlash, "X", &xy) && !is_shown(Class::Backlash, "Z", &xy));
        assert!(is_shown(Class::Squareness, "XY", &xy) && !is_shown(Class::Squareness, "XZ", &xy));
        assert!(is_shown(Class::AngularError, "CX", &xy));
        assert!(is_shown(Class::ScrewElongation, "Z", &xy), "blocks do");
        assert!(is_shown(Class::ClockOffset, "grid", &xy));
    }

    #[test]
    fn every_rival_is_one_that_a_machine_can_have() {
        for class in CLASSES {
            for axis in class.axes() {
                let hidden = Hidden {
                    class,
                    axis,
                    size: 1.0,
                    is_foreign: true,
                    shape: [0.5; 2],
                };
                for (rival, on) in rivals(&hidden) {
                    assert!(
                        rival.axes().contains(&on),
                        "{class:?} {axis}: {rival:?} {on}"
                    );
                    assert!((rival, on) != (class, *axis), "{class:?} {axis}");
                }
            }
        }
    }
}
