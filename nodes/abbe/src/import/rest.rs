//! Where the axes stand that a test does not move, if nobody stated it.

use machine::MachineFile;
use metrology::Axis;
use metrology::number::number;

use super::map::{Map, Test};
use super::plain_machine::NO_MACHINE;

/// Farthest from zero that a place is assumed, mm: a reflector's usual height above a table.
const FARTHEST_MM: f64 = 250.0;

/// Places the linear axes that a positioning test does not move and its map does not state half-way to the farther end of
/// their travel; a line that states so, or none where nothing was assumed.
///
/// With every axis at zero a linear axis has no Abbe offset, and an angular error could never be what the test shows. Away
/// from zero the diagnosis keeps it among what reads the same. Sizes of what acts along the axis do not depend on it.
pub fn assume(map: &mut Map, machine: &MachineFile) -> Option<String> {
    let Test::Positioning { axis: moved, .. } = &map.test else {
        return None;
    };
    if !moved.is_linear() || machine.name == NO_MACHINE {
        return None;
    }
    let open = Axis::LINEAR.into_iter().filter_map(|axis| {
        let travel_mm = machine.linear(axis)?.travel_mm;
        let is_open = axis != *moved && !map.at_mm.contains_key(&axis);
        is_open.then(|| (axis, half_way(travel_mm)))
    });
    let assumed: Vec<(Axis, f64)> = open.filter(|(_, at_mm)| *at_mm != 0.0).collect();
    map.at_mm.extend(assumed.iter().copied());
    let places: Vec<String> = assumed
        .iter()
        .map(|(axis, at_mm)| format!("{axis}: {}", number(*at_mm)))
        .collect();
    let places = places.join(", ");
    (!assumed.is_empty()).then(|| {
        format!(
            "warning, at_mm = {{{places}}} mm is assumed, for nobody stated where these axes stood: which angular errors could be the cause \
             depends on it; state at_mm in a map"
        )
    })
}

/// The middle between zero and the end of a travel that is farther from it, in whole millimetres.
fn half_way([low, high]: [f64; 2]) -> f64 {
    let end = if low.abs() > high.abs() { low } else { high };
    (end / 2.0)
        .clamp(-FARTHEST_MM, FARTHEST_MM)
        .trunc()
        .clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_lies_within_the_travel_and_not_at_zero() {
        for (travel, at_mm) in [
            ([-240.0, 240.0], 120.0),
            ([-60.0, 440.0], 220.0),
            ([-400.0, 0.0], -200.0),
            ([300.0, 340.0], 300.0),
            ([-5000.0, 4000.0], -250.0),
        ] {
            assert!((half_way(travel) - at_mm).abs() < 1e-9, "{travel:?}");
        }
    }
}
