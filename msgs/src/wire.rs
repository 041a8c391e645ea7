//! Between the wire (SI) and the inside (millimetres): the only place of that conversion.
//!
//! ```text
//!   length on the wire [m] = length inside [mm] / 1000        (1)
//!   length inside [mm]     = length on the wire [m] * 1000    (2)
//!   sec on the wire [s]    = whole seconds modulo 2^32, as i32  (3)
//! ```
//!
//! Angles, ratios, times and temperatures have one unit on both sides. (2) after (1) gives the
//! length back within one unit in the last place, and every further turn gives the same bits; a
//! value that must be the same live and in replay is therefore taken through [`Wire::as_received`].
//!
//! A NaN or an infinity is refused unless the field's comment in the `.msg` file gives it a meaning. A finite number above
//! 1e18 is refused too: no machine has it, and products of what is below stay finite.
//! Stamps are instants from 0 to 2^32 s of their clock, 1970 to 2106. `builtin_interfaces/Time` has `int32 sec`;
//! (3) reads and writes its bits as those of an unsigned number, so a negative `sec` is an instant of 2038 to 2106.
//! A stamp outside has no wire form: it is written as (-1 s, 2^32 - 1 ns), DDS's invalid time, which
//! [`Wire::to_inner`] refuses for its nanoseconds.
//!
//! # Agreement
//! `prop_eq2_gives_a_length_back_within_one_ulp_and_then_the_same_bits`: 30,000 lengths of 1e-15 mm
//! to 1e9 mm.
//!
//! # References
//! REP 103 for the units of the wire; OMG DDS 1.4, 2.3.2 for the invalid time; `rclcpp/src/rclcpp/time.cpp`,
//! `convert_rcl_time_to_sec_nanos`, for (3).

mod allowed;

use metrology::bound::{Range, TEMPERATURE};
use metrology::stamp::NANOS_PER_S;
use metrology::{Axis, AxisSet, Clock, PerAxis, Stamp};
use nalgebra::Vector3;

pub(crate) use allowed::Allowed;

use crate::builtin_interfaces::msg::Time;
use crate::geometry_msgs::msg::{Point, Vector3 as WireVector};
use crate::{Message, Place, WireError, bounds};

/// A message with an inner form in millimetres.
pub trait Wire: Message {
    /// The inner form.
    type Inner;

    /// Overwrites this message by the wire form of `inner`, reusing its buffers.
    fn set_from_inner(&mut self, inner: &Self::Inner);

    /// The inner form.
    ///
    /// # Errors
    /// When a value has no inner form; the error names message, field, value and limit.
    fn to_inner(&self) -> Result<Self::Inner, WireError>;

    /// The wire form of `inner`.
    #[must_use]
    fn from_inner(inner: &Self::Inner) -> Self {
        let mut message = Self::default();
        message.set_from_inner(inner);
        message
    }

    /// The inner form.
    ///
    /// # Errors
    /// As [`Wire::to_inner`].
    fn into_inner(self) -> Result<Self::Inner, WireError> {
        self.to_inner()
    }

    /// What a reader makes of `inner` once it has been on the wire.
    ///
    /// # Errors
    /// As [`Wire::to_inner`].
    fn as_received(inner: &Self::Inner) -> Result<Self::Inner, WireError> {
        Self::from_inner(inner).into_inner()
    }
}

const MM_PER_M: f64 = 1000.0;

/// Greatest magnitude of a finite number on the wire, in the unit of its field: 100 light years of length, more than the
/// age of the universe in seconds. The tenth power of a million times that is still finite.
pub(crate) const GREATEST_NUMBER: f64 = 1e18;

/// (1)
pub(crate) fn metres(length_mm: f64) -> f64 {
    length_mm / MM_PER_M
}

/// (2)
pub(crate) fn millimetres(length_m: f64) -> f64 {
    length_m * MM_PER_M
}

/// No instant: its nanoseconds are beyond a second.
const INVALID_TIME: Time = Time {
    sec: -1,
    nanosec: u32::MAX,
};

/// The wire form of an instant, or the invalid time where there is none.
///
/// (3): `sec` is the bit pattern of an unsigned number, so that 2038 to 2106 are carried; `rclcpp` writes the same.
#[must_use]
pub fn time<C: Clock>(stamp: Stamp<C>) -> Time {
    let sec = u32::try_from(stamp.nanos().div_euclid(NANOS_PER_S));
    let nanosec = u32::try_from(stamp.nanos().rem_euclid(NANOS_PER_S));
    match (sec, nanosec) {
        (Ok(sec), Ok(nanosec)) => Time {
            sec: sec.cast_signed(),
            nanosec,
        },
        _ => INVALID_TIME,
    }
}

/// The instant of a wire form by (3); `None`: its nanoseconds are beyond a second.
#[must_use]
pub fn instant<C: Clock>(time: &Time) -> Option<Stamp<C>> {
    let nanosec = i64::from(time.nanosec);
    let sec = i64::from(time.sec.cast_unsigned());
    (nanosec < NANOS_PER_S).then(|| Stamp::from_nanos(sec * NANOS_PER_S + nanosec))
}

pub(crate) fn point(place_mm: &Vector3<f64>) -> Point {
    Point {
        x: metres(place_mm.x),
        y: metres(place_mm.y),
        z: metres(place_mm.z),
    }
}

/// A difference of two places.
pub(crate) fn lengths(vector_mm: &Vector3<f64>) -> WireVector {
    ratios(&vector_mm.map(metres))
}

/// A dimensionless vector.
pub(crate) fn ratios(vector: &Vector3<f64>) -> WireVector {
    WireVector {
        x: vector.x,
        y: vector.y,
        z: vector.z,
    }
}

pub(crate) fn set_letters(letters: &mut Vec<String>, axes: AxisSet) {
    letters.resize_with(axes.len(), String::new);
    for (letter, axis) in letters.iter_mut().zip(axes.iter()) {
        letter.clear();
        letter.push_str(axis.letter());
    }
}

/// Positions or velocities of the axes: (1) for linear axes.
pub(crate) fn set_positions(out: &mut Vec<f64>, axes: AxisSet, values: &PerAxis<f64>) {
    out.clear();
    out.extend(axes.iter().map(|axis| {
        if axis.is_linear() {
            metres(values[axis])
        } else {
            values[axis]
        }
    }));
}

/// The axes of a message in the order of its arrays.
pub(crate) struct Letters {
    axes: [Axis; 6],
    len: usize,
}

impl Letters {
    pub(crate) fn set(&self) -> AxisSet {
        self.as_slice().iter().copied().collect()
    }

    fn as_slice(&self) -> &[Axis] {
        &self.axes[..self.len]
    }
}

/// Reads the fields of one message and names it in every error.
#[derive(Clone, Copy)]
pub(crate) struct Reader {
    message: &'static str,
}

impl Reader {
    pub(crate) const fn of<M: Message>() -> Self {
        Self {
            message: M::TYPE_NAME,
        }
    }

    pub(crate) fn number(
        self,
        field: &'static str,
        place: Place,
        value: f64,
        allowed: Allowed,
    ) -> Result<f64, WireError> {
        if !value.is_infinite() && value.abs() > GREATEST_NUMBER && !allowed.is_unused() {
            return Err(WireError::TooLarge {
                message: self.message,
                field,
                place,
                value,
                greatest: GREATEST_NUMBER,
            });
        }
        if allowed.takes(value) {
            return Ok(value);
        }
        Err(WireError::NotFinite {
            message: self.message,
            field,
            place,
            value,
            allowed: allowed.words(),
        })
    }

    pub(crate) fn finite(self, field: &'static str, value: f64) -> Result<f64, WireError> {
        self.number(field, Place::Whole, value, Allowed::Finite)
    }

    /// A temperature that a thermometer of a machine can read.
    pub(crate) fn temperature_degc(
        self,
        field: &'static str,
        value: f64,
    ) -> Result<f64, WireError> {
        let value = self.finite(field, value)?;
        let place = || "temperature".to_owned();
        match TEMPERATURE.check(place, value) {
            Ok(()) => Ok(value),
            Err(source) => Err(WireError::Quantity {
                message: self.message,
                field,
                source,
            }),
        }
    }

    /// A finite number in the range of its quantity, in the unit of the wire.
    pub(crate) fn inside(
        self,
        field: &'static str,
        place: Place,
        value: f64,
        range: Range,
    ) -> Result<f64, WireError> {
        let value = self.number(field, place, value, Allowed::Finite)?;
        let entry = || match place {
            Place::Entry(idx) => format!("entry {idx}"),
            _ => "value".to_owned(),
        };
        match range.check(entry, value) {
            Ok(()) => Ok(value),
            Err(source) => Err(WireError::Quantity {
                message: self.message,
                field,
                source,
            }),
        }
    }

    /// A list that is not longer than anybody means.
    pub(crate) fn at_most(
        self,
        field: &'static str,
        n: usize,
        greatest: usize,
    ) -> Result<(), WireError> {
        self.amount(field, n, "entries", greatest)
    }

    /// A name: of a feature, a sensor, a host.
    pub(crate) fn name(self, field: &'static str, text: &str) -> Result<String, WireError> {
        self.text(field, text, bounds::NAME_BYTES)
    }

    /// A text of at most so many bytes.
    pub(crate) fn text(
        self,
        field: &'static str,
        text: &str,
        greatest: usize,
    ) -> Result<String, WireError> {
        self.amount(field, text.len(), "bytes of text", greatest)?;
        Ok(text.to_owned())
    }

    /// A list of names.
    pub(crate) fn names(
        self,
        field: &'static str,
        names: &[String],
    ) -> Result<Vec<String>, WireError> {
        self.at_most(field, names.len(), bounds::NAMES)?;
        names.iter().map(|name| self.name(field, name)).collect()
    }

    fn amount(
        self,
        field: &'static str,
        n: usize,
        what: &'static str,
        greatest: usize,
    ) -> Result<(), WireError> {
        if n <= greatest {
            return Ok(());
        }
        Err(WireError::TooMany {
            message: self.message,
            field,
            n,
            what,
            greatest,
        })
    }

    /// (2) of a finite length.
    pub(crate) fn length_mm(self, field: &'static str, value_m: f64) -> Result<f64, WireError> {
        self.finite(field, value_m).map(millimetres)
    }

    pub(crate) fn point_mm(
        self,
        field: &'static str,
        point: &Point,
        allowed: Allowed,
    ) -> Result<Vector3<f64>, WireError> {
        self.vector(field, [point.x, point.y, point.z], allowed)
            .map(|place_m| place_m.map(millimetres))
    }

    pub(crate) fn ratios(
        self,
        field: &'static str,
        vector: &WireVector,
        allowed: Allowed,
    ) -> Result<Vector3<f64>, WireError> {
        self.vector(field, [vector.x, vector.y, vector.z], allowed)
    }

    pub(crate) fn lengths_mm(
        self,
        field: &'static str,
        vector: &WireVector,
    ) -> Result<Vector3<f64>, WireError> {
        self.ratios(field, vector, Allowed::Finite)
            .map(|vector_m| vector_m.map(millimetres))
    }

    fn vector(
        self,
        field: &'static str,
        values: [f64; 3],
        allowed: Allowed,
    ) -> Result<Vector3<f64>, WireError> {
        for (axis, value) in Axis::LINEAR.into_iter().zip(values) {
            self.number(field, Place::Axis(axis), value, allowed)?;
        }
        Ok(Vector3::from(values))
    }

    pub(crate) fn stamp<C: Clock>(
        self,
        field: &'static str,
        place: Place,
        time: &Time,
    ) -> Result<Stamp<C>, WireError> {
        instant(time).ok_or(WireError::StampOutOfRange {
            message: self.message,
            field,
            place,
            sec: time.sec.cast_unsigned(),
            nanosec: time.nanosec,
        })
    }

    pub(crate) fn letters(
        self,
        field: &'static str,
        names: &[String],
    ) -> Result<Letters, WireError> {
        self.letters_among(field, names, &Axis::ALL, "X Y Z A B C")
    }

    /// Letters of rotary axes.
    pub(crate) fn rotary_letters(
        self,
        field: &'static str,
        names: &[String],
    ) -> Result<Letters, WireError> {
        self.letters_among(field, names, &Axis::ROTARY, "A B C")
    }

    fn letters_among(
        self,
        field: &'static str,
        names: &[String],
        among: &[Axis],
        allowed: &'static str,
    ) -> Result<Letters, WireError> {
        let mut letters = Letters {
            axes: Axis::ALL,
            len: 0,
        };
        for (idx, name) in names.iter().enumerate() {
            let axis = self.letter(field, idx, name, among, allowed)?;
            if letters.as_slice().contains(&axis) {
                return Err(WireError::DuplicateAxis {
                    message: self.message,
                    field,
                    axis,
                });
            }
            letters.axes[letters.len] = axis;
            letters.len += 1;
        }
        Ok(letters)
    }

    /// A linear axis.
    pub(crate) fn linear_axis(
        self,
        field: &'static str,
        idx: usize,
        name: &str,
    ) -> Result<Axis, WireError> {
        self.letter(field, idx, name, &Axis::LINEAR, "X Y Z")
    }

    /// A rotary axis.
    pub(crate) fn rotary_axis(
        self,
        field: &'static str,
        idx: usize,
        name: &str,
    ) -> Result<Axis, WireError> {
        self.letter(field, idx, name, &Axis::ROTARY, "A B C")
    }

    /// Any axis.
    pub(crate) fn axis(
        self,
        field: &'static str,
        idx: usize,
        name: &str,
    ) -> Result<Axis, WireError> {
        self.letter(field, idx, name, &Axis::ALL, "X Y Z A B C")
    }

    /// An array that must have as many entries as another says.
    pub(crate) fn length(
        self,
        field: &'static str,
        len: usize,
        needed: usize,
    ) -> Result<(), WireError> {
        if len == needed {
            return Ok(());
        }
        Err(WireError::WrongLength {
            message: self.message,
            field,
            len,
            needed,
        })
    }

    fn letter(
        self,
        field: &'static str,
        idx: usize,
        name: &str,
        among: &[Axis],
        allowed: &'static str,
    ) -> Result<Axis, WireError> {
        let found = among.iter().find(|axis| axis.letter() == name);
        found.copied().ok_or_else(|| WireError::UnknownAxis {
            message: self.message,
            field,
            idx,
            name: name.to_owned(),
            allowed,
        })
    }

    pub(crate) fn duplicate(self, field: &'static str, axis: Axis) -> WireError {
        WireError::DuplicateAxis {
            message: self.message,
            field,
            axis,
        }
    }

    /// Values of the axes; those without an entry keep that of `absent`.
    pub(crate) fn per_axis<W: Copy, T: Copy>(
        self,
        field: &'static str,
        letters: &Letters,
        values: &[W],
        absent: T,
        read: impl Fn(Axis, W) -> Result<T, WireError>,
    ) -> Result<PerAxis<T>, WireError> {
        let axes = letters.as_slice();
        if values.len() != axes.len() {
            return Err(WireError::LengthDiffers {
                message: self.message,
                field,
                len: values.len(),
                axes: axes.len(),
            });
        }
        let mut out = PerAxis([absent; 6]);
        for (axis, value) in axes.iter().zip(values) {
            out[*axis] = read(*axis, *value)?;
        }
        Ok(out)
    }

    /// Positions or velocities of the axes: (2) for linear axes; absent ones get `absent`.
    pub(crate) fn positions(
        self,
        field: &'static str,
        letters: &Letters,
        values: &[f64],
        absent: f64,
        allowed: Allowed,
    ) -> Result<PerAxis<f64>, WireError> {
        self.per_axis(field, letters, values, absent, |axis, value| {
            let value = self.number(field, Place::Axis(axis), value, allowed)?;
            Ok(if axis.is_linear() {
                millimetres(value)
            } else {
                value
            })
        })
    }

    /// The variant whose code is `value`; codes count from 0.
    pub(crate) fn variant<T: Copy>(
        self,
        field: &'static str,
        place: Place,
        value: u8,
        all: &[T],
        code: fn(T) -> u8,
    ) -> Result<T, WireError> {
        let found = all.iter().find(|variant| code(**variant) == value);
        found.copied().ok_or_else(|| WireError::UnknownValue {
            message: self.message,
            field,
            place,
            value,
            greatest: all.iter().map(|variant| code(*variant)).max().unwrap_or(0),
        })
    }

    pub(crate) fn contradiction(
        self,
        (field, value): (&'static str, bool),
        (other, other_value): (&'static str, u8),
    ) -> WireError {
        WireError::Contradiction {
            message: self.message,
            field,
            value,
            other,
            other_value,
        }
    }
}
