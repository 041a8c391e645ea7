//! What the errors of an axis are counted from.

use metrology::{Axis, AxisSet, PerAxis};

use super::origin::Which;

/// What is counted from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counting {
    pub which: Which,
    /// First and last position of each axis whose positioning is in a file, mm or rad.
    pub spans: PerAxis<Option<(f64, f64)>>,
    /// Where the control's reference point of each axis lies, mm or rad.
    pub reference: PerAxis<f64>,
    /// Axes whose reference point was named.
    pub named: AxisSet,
    pub relative_to_reference: bool,
}

/// Positions that differ by less are one, mm or rad.
const EQUAL_POSITIONS: f64 = 1e-7;

impl Counting {
    /// Axes whose positioning is in a file, each with its first and last position, mm or rad.
    pub fn written(&self) -> impl Iterator<Item = (Axis, (f64, f64))> {
        Axis::ALL
            .into_iter()
            .filter_map(|axis| Some((axis, self.spans[axis]?)))
    }

    /// Refuses a named reference point where no error was recorded that could be counted from.
    pub fn check(&self) -> Result<(), String> {
        let is_named = |(axis, _): &(Axis, _)| self.named.contains(*axis);
        for (axis, (first, last)) in self.written().filter(is_named) {
            let at = self.reference[axis];
            if self.relative_to_reference
                && !(first - EQUAL_POSITIONS..=last + EQUAL_POSITIONS).contains(&at)
            {
                return Err(format!(
                    "--reference {axis}={}: the errors of {axis} in the table reach from {} to {}: \
                     name a position in there, or count from no reference point (--absolute)",
                    shown(axis, at).0,
                    shown(axis, first).0,
                    in_unit(axis, last)
                ));
            }
        }
        Ok(())
    }

    /// What the errors of an axis are counted from, in words.
    pub fn zero(&self, axis: Axis, (first, last): (f64, f64)) -> String {
        if !self.relative_to_reference {
            return format!(
                "errors of {axis} are not counted from the reference point (--absolute): nothing is taken out so that they are 0 there"
            );
        }
        let wanted = self.reference[axis];
        let at = wanted.clamp(first, last);
        let beyond = if (at - wanted).abs() > EQUAL_POSITIONS {
            format!(
                ", where the table ends ({} lies outside of it)",
                in_unit(axis, wanted)
            )
        } else {
            String::new()
        };
        format!(
            "errors of {axis} counted from the error at {}{beyond}, which a control puts right when it is referenced there \
             (--reference {axis}=..., --absolute)",
            in_unit(axis, at)
        )
    }
}

/// A position as a person reads it, to a nanometre: a value in mm or deg, and the unit.
fn shown(axis: Axis, at: f64) -> (f64, &'static str) {
    let (at, unit) = if axis.is_linear() {
        (at, "mm")
    } else {
        (at.to_degrees(), "deg")
    };
    ((at * 1e6).round() / 1e6 + 0.0, unit)
}

fn in_unit(axis: Axis, at: f64) -> String {
    let (at, unit) = shown(axis, at);
    format!("{at} {unit}")
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Of X alone, from 0 to 80 mm, counted from 0.
    pub fn of_x() -> Counting {
        let mut spans = PerAxis::default();
        spans[Axis::X] = Some((0.0, 80.0));
        Counting {
            which: Which::Last,
            spans,
            reference: PerAxis::default(),
            named: AxisSet::EMPTY,
            relative_to_reference: true,
        }
    }

    #[test]
    fn a_reference_beyond_the_table_is_refused_where_it_was_named_and_told_where_not() {
        let mut counting = of_x();
        counting.reference[Axis::X] = 9999.0;
        assert_eq!(counting.check(), Ok(()));
        let told = counting.zero(Axis::X, (0.0, 80.0));
        let ends = "at 80 mm, where the table ends (9999 mm lies outside of it)";
        assert!(told.contains(ends), "{told}");
        counting.named = AxisSet::EMPTY.with(Axis::X).with(Axis::Y);
        let refused = counting.check().unwrap_err();
        assert!(refused.starts_with("--reference X=9999: "), "{refused}");
        assert!(refused.contains("from 0 to 80 mm"), "{refused}");
        counting.relative_to_reference = false;
        assert_eq!(counting.check(), Ok(()));
    }
}
