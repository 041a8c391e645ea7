//! The numbers of a value by the path of their keys, and the table of ranges that they are checked against.
//!
//! A file of a machine has many numbers. Each kind of file has one table with a range for each key; [`check`] walks the whole
//! value, so that no number is left out by a check that somebody forgot to write.

use std::fmt;

use serde::Serialize;
use serde::ser::{
    SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant, SerializeTuple,
    SerializeTupleStruct, SerializeTupleVariant, Serializer,
};

use crate::bound::BoundError;
use crate::number::unit_of;

/// The range of the numbers that stand under a key: name with its unit, least, greatest, both allowed.
pub type Row = (&'static str, f64, f64);

/// The range of the number at `path`: the row of its key, or else of the key above it, as in `standing_heat_w.bed`.
#[must_use]
pub fn range_of(rows: &[Row], path: &str) -> Option<Row> {
    let name = |segment: &str| segment.split('[').next().unwrap_or(segment).to_owned();
    let mut above = path.rsplit('.').map(name);
    let mut find = || {
        let name = above.next()?;
        rows.iter().find(|(key, ..)| *key == name).copied()
    };
    find().or_else(find)
}

/// Refuses the first number of `value` that is outside the range of its key.
///
/// # Errors
/// With path, value, range and unit; a number whose key has no row is checked for being finite alone.
pub fn check(rows: &[Row], value: &impl Serialize) -> Result<(), BoundError> {
    let mut first = Ok(());
    each_number(value, &mut |path, number| {
        if first.is_err() {
            return;
        }
        first = check_number(rows, path, number);
    });
    first
}

/// The same of one number at `path`.
///
/// # Errors
/// As [`check`].
pub fn check_number(rows: &[Row], path: &str, number: f64) -> Result<(), BoundError> {
    let (key, least, greatest) = range_of(rows, path).unwrap_or(("", f64::MIN, f64::MAX));
    if (least..=greatest).contains(&number) {
        return Ok(());
    }
    Err(BoundError::Number {
        place: path.to_owned(),
        value: number,
        least,
        greatest,
        unit: unit_of(key)
            .map_or_else(String::new, |unit| format!(" {unit}"))
            .into(),
    })
}

/// Hands every number that is not a count to `take`, with its path, such as `axes.X.travel_mm[1]`.
pub fn each_number(value: &impl Serialize, take: &mut dyn FnMut(&str, f64)) {
    each(value, false, take);
}

/// The same with counts: those beyond 2^53 are rounded.
pub fn each_number_and_count(value: &impl Serialize, take: &mut dyn FnMut(&str, f64)) {
    each(value, true, take);
}

fn each(value: &impl Serialize, with_counts: bool, take: &mut dyn FnMut(&str, f64)) {
    let mut walk = Walk {
        path: String::new(),
        key: String::new(),
        with_counts,
        take,
    };
    // It fails for no value: nothing is written.
    let _ = value.serialize(&mut walk);
}

struct Walk<'t> {
    path: String,
    /// The text that came last: the name of a map's entry.
    key: String,
    with_counts: bool,
    take: &'t mut dyn FnMut(&str, f64),
}

impl Walk<'_> {
    fn count(&mut self, count: f64) -> fmt::Result {
        if self.with_counts {
            (self.take)(&self.path, count);
        }
        Ok(())
    }

    fn below(&mut self, segment: &str, value: &(impl Serialize + ?Sized)) -> fmt::Result {
        let length = self.path.len();
        if length > 0 && !segment.starts_with('[') {
            self.path.push('.');
        }
        self.path.push_str(segment);
        let result = value.serialize(&mut *self);
        self.path.truncate(length);
        result
    }
}

/// A list, map or structure on the way.
struct Inner<'w, 't> {
    walk: &'w mut Walk<'t>,
    n: usize,
    key: String,
}

impl Inner<'_, '_> {
    fn next(&mut self, value: &(impl Serialize + ?Sized)) -> fmt::Result {
        let segment = format!("[{}]", self.n);
        self.n += 1;
        self.walk.below(&segment, value)
    }
}

macro_rules! passed_over {
    ($($name:ident: $type:ty),*) => {
        $(fn $name(self, _: $type) -> fmt::Result {
            Ok(())
        })*
    };
}

macro_rules! count {
    ($($name:ident: $type:ty),*) => {
        $(fn $name(self, count: $type) -> fmt::Result {
            self.count(f64::from(count))
        })*
    };
}

macro_rules! list {
    ($($trait:ident::$name:ident),*) => {
        $(impl $trait for Inner<'_, '_> {
            type Ok = ();
            type Error = fmt::Error;

            fn $name<T: Serialize + ?Sized>(&mut self, value: &T) -> fmt::Result {
                self.next(value)
            }

            fn end(self) -> fmt::Result {
                Ok(())
            }
        })*
    };
}

macro_rules! structure {
    ($($trait:ident),*) => {
        $(impl $trait for Inner<'_, '_> {
            type Ok = ();
            type Error = fmt::Error;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                key: &'static str,
                value: &T,
            ) -> fmt::Result {
                self.walk.below(key, value)
            }

            fn end(self) -> fmt::Result {
                Ok(())
            }
        })*
    };
}

list!(
    SerializeSeq::serialize_element,
    SerializeTuple::serialize_element,
    SerializeTupleStruct::serialize_field,
    SerializeTupleVariant::serialize_field
);
structure!(SerializeStruct, SerializeStructVariant);

impl SerializeMap for Inner<'_, '_> {
    type Ok = ();
    type Error = fmt::Error;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> fmt::Result {
        self.walk.key.clear();
        key.serialize(&mut *self.walk)?;
        self.key = std::mem::take(&mut self.walk.key);
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> fmt::Result {
        let key = std::mem::take(&mut self.key);
        self.walk.below(&key, value)
    }

    fn end(self) -> fmt::Result {
        Ok(())
    }
}

impl<'w, 't> Serializer for &'w mut Walk<'t> {
    type Ok = ();
    type Error = fmt::Error;
    type SerializeSeq = Inner<'w, 't>;
    type SerializeTuple = Inner<'w, 't>;
    type SerializeTupleStruct = Inner<'w, 't>;
    type SerializeTupleVariant = Inner<'w, 't>;
    type SerializeMap = Inner<'w, 't>;
    type SerializeStruct = Inner<'w, 't>;
    type SerializeStructVariant = Inner<'w, 't>;

    passed_over!(
        serialize_bool: bool,
        serialize_char: char,
        serialize_bytes: &[u8],
        serialize_unit_struct: &'static str
    );
    count!(
        serialize_i8: i8,
        serialize_i16: i16,
        serialize_i32: i32,
        serialize_u8: u8,
        serialize_u16: u16,
        serialize_u32: u32
    );

    #[expect(
        clippy::cast_precision_loss,
        reason = "a count is compared with limits"
    )]
    fn serialize_i64(self, count: i64) -> fmt::Result {
        self.count(count as f64)
    }

    #[expect(
        clippy::cast_precision_loss,
        reason = "a count is compared with limits"
    )]
    fn serialize_u64(self, count: u64) -> fmt::Result {
        self.count(count as f64)
    }

    fn serialize_f32(self, value: f32) -> fmt::Result {
        self.serialize_f64(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> fmt::Result {
        (self.take)(&self.path, value);
        Ok(())
    }

    fn serialize_str(self, text: &str) -> fmt::Result {
        text.clone_into(&mut self.key);
        Ok(())
    }

    fn serialize_none(self) -> fmt::Result {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> fmt::Result {
        value.serialize(self)
    }

    fn serialize_unit(self) -> fmt::Result {
        Ok(())
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, name: &'static str) -> fmt::Result {
        self.serialize_str(name)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> fmt::Result {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        value: &T,
    ) -> fmt::Result {
        self.below(name, value)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Inner<'w, 't>, fmt::Error> {
        Ok(Inner::of(self))
    }

    fn serialize_tuple(self, _: usize) -> Result<Inner<'w, 't>, fmt::Error> {
        Ok(Inner::of(self))
    }

    fn serialize_tuple_struct(
        self,
        _: &'static str,
        _: usize,
    ) -> Result<Inner<'w, 't>, fmt::Error> {
        Ok(Inner::of(self))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Inner<'w, 't>, fmt::Error> {
        Ok(Inner::of(self))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Inner<'w, 't>, fmt::Error> {
        Ok(Inner::of(self))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Inner<'w, 't>, fmt::Error> {
        Ok(Inner::of(self))
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Inner<'w, 't>, fmt::Error> {
        Ok(Inner::of(self))
    }
}

impl<'w, 't> Inner<'w, 't> {
    const fn of(walk: &'w mut Walk<'t>) -> Self {
        Self {
            walk,
            n: 0,
            key: String::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::axis::Axis;

    #[derive(Serialize)]
    struct Slide {
        travel_mm: [f64; 2],
        scale_um: Option<f64>,
        form: Vec<Form>,
        repeats: u32,
    }

    #[derive(Serialize)]
    #[serde(tag = "kind")]
    enum Form {
        Bow { height_um: f64 },
    }

    #[derive(Serialize)]
    #[serde(untagged)]
    enum Entry {
        Slide(Slide),
    }

    #[derive(Serialize)]
    struct File {
        axes: BTreeMap<Axis, Entry>,
        heat_w: BTreeMap<String, f64>,
    }

    fn file() -> File {
        let slide = Slide {
            travel_mm: [0.0, 500.0],
            scale_um: Some(0.1),
            form: vec![Form::Bow { height_um: 3.0 }],
            repeats: 7,
        };
        File {
            axes: BTreeMap::from([(Axis::Y, Entry::Slide(slide))]),
            heat_w: BTreeMap::from([("bed".to_owned(), 40.0)]),
        }
    }

    const ROWS: &[Row] = &[
        ("travel_mm", -1e3, 1e3),
        ("scale_um", 1e-3, 10.0),
        ("height_um", 0.0, 5.0),
        ("heat_w", 0.0, 100.0),
    ];

    #[test]
    fn every_number_has_the_path_of_its_keys() {
        let mut found = vec![];
        each_number(&file(), &mut |path, value| {
            found.push((path.to_owned(), value))
        });
        let wanted = [
            ("axes.Y.travel_mm[0]", 0.0),
            ("axes.Y.travel_mm[1]", 500.0),
            ("axes.Y.scale_um", 0.1),
            ("axes.Y.form[0].height_um", 3.0),
            ("heat_w.bed", 40.0),
        ];
        assert_eq!(found, wanted.map(|(path, value)| (path.to_owned(), value)));
    }

    #[test]
    fn a_number_outside_the_range_of_its_key_is_refused_with_path_value_range_and_unit() {
        assert_eq!(check(ROWS, &file()), Ok(()));
        let with = |change: fn(&mut File, &mut Slide)| {
            let mut file = file();
            let Some(Entry::Slide(mut slide)) = file.axes.remove(&Axis::Y) else {
                unreachable!("the file has Y");
            };
            change(&mut file, &mut slide);
            file.axes.insert(Axis::Y, Entry::Slide(slide));
            check(ROWS, &file).unwrap_err().to_string()
        };
        for (said, wanted) in [
            (
                with(|_, slide| slide.travel_mm[1] = 1e5),
                "axes.Y.travel_mm[1] = 100000 mm: must be from -1000 to 1000 mm",
            ),
            (
                with(|_, slide| slide.scale_um = Some(1e-300)),
                "axes.Y.scale_um = 1e-300 µm: must be from 0.001 to 10 µm",
            ),
            (
                with(|_, slide| {
                    slide.form[0] = Form::Bow {
                        height_um: f64::NAN,
                    }
                }),
                "axes.Y.form[0].height_um = NaN µm: must be from 0 to 5 µm",
            ),
            (
                with(|file, _| {
                    file.heat_w.insert("bed".to_owned(), f64::INFINITY);
                }),
                "heat_w.bed = inf W: must be from 0 to 100 W",
            ),
        ] {
            assert_eq!(said, wanted);
        }
    }
}
