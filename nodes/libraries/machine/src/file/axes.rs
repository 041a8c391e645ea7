//! Reads the axes: the letter decides whether an entry is linear or rotary, so that a wrong key is
//! refused by its own name and place.

use std::collections::BTreeMap;
use std::fmt;

use metrology::Axis;
use schemars::{Schema, SchemaGenerator};
use serde::de::{Deserializer, Error, MapAccess, Visitor};

use super::{AxisEntry, LinearAxisEntry, RotaryAxisEntry};

/// Reads a map of axes by letter.
pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<Axis, AxisEntry>, D::Error> {
    deserializer.deserialize_map(Axes)
}

/// What [`deserialize`] takes, for editors: which keys an axis has follows from its letter.
pub(super) fn schema(generator: &mut SchemaGenerator) -> Schema {
    let mut entries = Schema::default();
    for axis in Axis::ALL {
        let entry = if axis.is_linear() {
            generator.subschema_for::<LinearAxisEntry>()
        } else {
            generator.subschema_for::<RotaryAxisEntry>()
        };
        entries.insert(axis.letter().to_owned(), entry.to_value());
    }
    let mut schema = Schema::default();
    schema.insert("type".to_owned(), "object".into());
    schema.insert("properties".to_owned(), entries.to_value());
    schema.insert("additionalProperties".to_owned(), false.into());
    schema
}

struct Axes;

impl<'de> Visitor<'de> for Axes {
    type Value = BTreeMap<Axis, AxisEntry>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("axes by their letters X Y Z A B C")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Self::Value, M::Error> {
        let mut axes = BTreeMap::new();
        while let Some(axis) = map.next_key::<Axis>()? {
            let entry = if axis.is_linear() {
                AxisEntry::Linear(map.next_value()?)
            } else {
                AxisEntry::Rotary(map.next_value()?)
            };
            if axes.insert(axis, entry).is_some() {
                return Err(M::Error::custom(format_args!("axis {axis} is given twice")));
            }
        }
        Ok(axes)
    }
}
