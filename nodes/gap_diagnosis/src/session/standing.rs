//! Readings that stand while the commanded motion changes what they read.
//!
//! # Model
//!
//! A coordinate stands over a stretch of readings that are the same to the last digit. A sensor that is stuck or at the end
//! of its range does so for longer than a machine can. Of a stretch, with the nominal value n, with w that it had gone one
//! way before the stretch, and e that it goes on that way in it:
//!
//! ```text
//!   w > 0.1 mm  and  e > 5 um                                             (1)
//!   max n - min n > 0.1 mm                                                (2)
//! ```
//!
//! A slide may stay where it is for some hundredths of a millimetre after its axis turned: that is a play, and no
//! reason to leave out what shows it. What the motion leaves at rest never stands too long.
//!
//! # Holds when
//! No play or friction holds a slide for 0.1 mm, and a sensor resolves 5 µm.

/// A coordinate that does not change over this way in the direction it went stands, mm.
const STUCK_MM: f64 = 5e-3;
/// More than any play, mm.
const PLAY_MM: f64 = 0.1;
/// A nominal value has turned when it has come back by so much, mm.
const TURNED_MM: f64 = 1e-3;

/// What one reading of a coordinate does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// It differs from the readings beside it.
    Changes,
    /// It is the same as one beside it, and may be so.
    Same,
    /// It is the same although the motion says that it cannot be.
    Stuck,
}

/// What each reading of a coordinate does, in order; `read_mm` and `nominal_mm` are of equal length.
pub(super) fn standing(read_mm: &[f64], nominal_mm: &[f64]) -> Vec<Standing> {
    let mut all = Vec::with_capacity(read_mm.len());
    let mut heading = Heading::default();
    for stretch in read_mm.chunk_by(|a, b| a.to_bits() == b.to_bits()) {
        let range = all.len()..all.len() + stretch.len();
        let nominal_mm = nominal_mm.get(range.clone()).unwrap_or(&[]);
        let answer = match nominal_mm {
            [] | [_] => Standing::Changes,
            [first, ..] if heading.to(*first).is_too_long(nominal_mm) => Standing::Stuck,
            _ => Standing::Same,
        };
        nominal_mm
            .iter()
            .for_each(|here| heading = heading.to(*here));
        all.resize(range.end, answer);
    }
    all
}

/// Which readings of a sensor's two coordinates are kept. Where one is stuck and the other is the same as well, the
/// sensor stands as a whole.
pub(super) fn both([first, second]: &[Vec<Standing>; 2]) -> Vec<[bool; 2]> {
    let of_pair = |(a, b): (&Standing, &Standing)| {
        let is_stuck = *a == Standing::Stuck || *b == Standing::Stuck;
        [*a, *b].map(|own| !is_stuck || own == Standing::Changes)
    };
    first.iter().zip(second).map(of_pair).collect()
}

/// Where a nominal value comes from.
#[derive(Clone, Copy, Debug, Default)]
struct Heading {
    /// Where it turned last, the furthest since, and the last.
    way_mm: Option<[f64; 2]>,
}

impl Heading {
    fn to(self, here: f64) -> Self {
        let Some([from, furthest]) = self.way_mm else {
            return Self {
                way_mm: Some([here, here]),
            };
        };
        let sense = if furthest < from { -1.0 } else { 1.0 };
        let back = (furthest - here) * sense;
        let way_mm = if back > TURNED_MM {
            [furthest, here]
        } else if back < 0.0 {
            [from, here]
        } else {
            [from, furthest]
        };
        Self {
            way_mm: Some(way_mm),
        }
    }

    /// (1) or (2) of a stretch that begins here.
    fn is_too_long(self, nominal_mm: &[f64]) -> bool {
        let (low, high) = nominal_mm
            .iter()
            .fold((f64::MAX, f64::MIN), |(low, high), n| {
                (low.min(*n), high.max(*n))
            });
        let Some([from, furthest]) = self.way_mm else {
            return false;
        };
        let further = if furthest < from {
            furthest - low
        } else {
            high - furthest
        };
        ((furthest - from).abs() > PLAY_MM && further > STUCK_MM) || high - low > PLAY_MM
    }
}
