//! Names by which a recording states the heights of its sensors.

/// Before the zero of a sensor, in a name that states its height.
const HEIGHT_OF: &str = "height_of_zero_";
/// Between that zero and the height.
const IS_MM: &str = "_mm=";

/// A name by which a recording states the height (mm) of the sensor whose readings have a zero: `height_of_zero_1_mm=110`.
#[must_use]
pub fn height_name(zero_id: u32, height_mm: f64) -> String {
    format!("{HEIGHT_OF}{zero_id}{IS_MM}{height_mm}")
}

/// Zero and height (mm) of such a name; none of another one.
#[must_use]
pub fn height_of(name: &str) -> Option<(u32, f64)> {
    let (zero, height) = name.strip_prefix(HEIGHT_OF)?.split_once(IS_MM)?;
    let height_mm: f64 = height.parse().ok()?;
    Some((zero.parse().ok()?, height_mm)).filter(|_| height_mm.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_height_reads_back_and_other_names_have_none() {
        for (zero_id, height_mm) in [(1, 110.0), (2, -0.125), (7, 260.5)] {
            let found = height_of(&height_name(zero_id, height_mm));
            assert_eq!(found, Some((zero_id, height_mm)));
        }
        for name in [
            "spindle",
            "height_of_zero_1",
            "height_of_zero_x_mm=1",
            "height_of_zero_1_mm=inf",
        ] {
            assert_eq!(height_of(name), None, "{name}");
        }
    }
}
