//! Offsets of work systems, and their text for a person.

use std::fmt;

/// Names of LinuxCNC's axes in the order of its parameters.
const AXES: [&str; 9] = ["X", "Y", "Z", "A", "B", "C", "U", "V", "W"];

/// A shift of the axes and a rotation about Z.
#[derive(Clone, Debug, PartialEq)]
pub struct Shift {
    /// mm, deg for A B C; in the order of the parameters.
    offsets: Vec<f64>,
    rotation_deg: f64,
}

impl Shift {
    /// Of offsets in the order of LinuxCNC's parameters.
    #[must_use]
    pub fn of(offsets: &[f64], rotation_deg: f64) -> Self {
        Self {
            offsets: offsets.iter().copied().take(AXES.len()).collect(),
            rotation_deg,
        }
    }

    /// Whether nothing is shifted: exactly, for an offset is set by a person or a program.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.is_zero_to(0.0)
    }

    /// Whether nothing is shifted by more than `limit`.
    #[must_use]
    pub fn is_zero_to(&self, limit: f64) -> bool {
        self.offsets
            .iter()
            .chain([&self.rotation_deg])
            .all(|value| value.abs() <= limit)
    }
}

impl fmt::Display for Shift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        for (index, (axis, offset)) in AXES.iter().zip(&self.offsets).enumerate() {
            if *offset != 0.0 {
                let unit = if (3..6).contains(&index) { "deg" } else { "mm" };
                parts.push(format!("{axis} {offset} {unit}"));
            }
        }
        if self.rotation_deg != 0.0 {
            parts.push(format!("R {} deg", self.rotation_deg));
        }
        f.write_str(&parts.join(", "))
    }
}

/// A work system as it was found.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkSystem {
    /// `G54` to `G59.3`.
    pub name: &'static str,
    /// What it shifts.
    pub shift: Shift,
}

/// Why a program cannot run while every work system is in use.
#[must_use]
pub fn all_in_use(systems: &[WorkSystem]) -> String {
    let each: Vec<String> = { systems.iter() }
        .map(|system| format!("{} {}", system.name, system.shift))
        .collect();
    format!(
        "machine coordinates: every work system has an offset or a rotation ({}), and none is overwritten: free one at \
         the control, e.g. G59.3 by G10 L2 P9 X0 Y0 Z0 R0",
        each.join("; ")
    )
}

/// Why a program cannot run under G92 or G52.
#[must_use]
pub fn shifted(shift: &Shift) -> String {
    format!(
        "machine coordinates: G92 or G52 shifts the axes by {shift}: clear it at the control (G92.1, or G52 X0 Y0 Z0)"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_is_told_by_axis_with_its_size() {
        let shift = Shift::of(&[1.5, 0.0, -0.25, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0], 0.5);
        assert_eq!(
            shift.to_string(),
            "X 1.5 mm, Z -0.25 mm, C 10 deg, R 0.5 deg"
        );
        assert!(!shift.is_zero());
        assert!(
            !Shift::of(&[0.0; 9], 0.5).is_zero(),
            "a rotation alone is one"
        );
        assert!(Shift::of(&[0.0, -0.0, 0.0], 0.0).is_zero());
    }

    #[test]
    fn refusals_say_what_was_found_and_what_to_do() {
        let of = |name, x| WorkSystem {
            name,
            shift: Shift::of(&[x], 0.0),
        };
        let told = all_in_use(&[of("G54", 1.5), of("G55", -2.0)]);
        assert!(told.contains("G54 X 1.5 mm; G55 X -2 mm"), "{told}");
        assert!(told.contains("G10 L2 P9"), "{told}");
        let told = shifted(&Shift::of(&[0.0, 3.0], 0.0));
        assert!(told.contains("Y 3 mm") && told.contains("G92.1"), "{told}");
    }
}
