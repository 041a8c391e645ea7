//! Parameters as one tree of values, and how a configuration is read out of it.
//!
//! Reading is strict, as ROS is: an integer is no double (`1` for `1.0` is refused), a number is no
//! text. Every error says where in the tree it is and what stands there.

use std::collections::BTreeMap;
use std::fmt;

use metrology::number::unit_of;
use metrology::yaml::{self, YamlError};
use serde::de::value::{MapAccessDeserializer, MapDeserializer, StrDeserializer};
use serde::de::{
    self, DeserializeSeed, Deserializer, EnumAccess, IntoDeserializer, MapAccess, SeqAccess,
    VariantAccess, Visitor,
};
use serde::{Deserialize, forward_to_deserialize_any};

/// A value, or values by name.
#[derive(Clone, Debug, PartialEq)]
pub enum Tree {
    /// Nothing: the same as if the key were absent.
    Null,
    /// `true`, `false`.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number with a point or an exponent.
    Double(f64),
    /// Text.
    String(String),
    /// Values in order.
    List(Vec<Tree>),
    /// Values by name.
    Map(BTreeMap<String, Tree>),
}

impl fmt::Display for Tree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => f.write_str("null"),
            Self::Bool(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Double(value) => write!(f, "{value:?}"),
            Self::String(value) => write!(f, "\"{value}\""),
            Self::List(values) => write!(f, "a list of {}", values.len()),
            Self::Map(values) => write!(f, "{} keys", values.len()),
        }
    }
}

impl Tree {
    /// An empty map.
    #[must_use]
    pub const fn empty() -> Self {
        Self::Map(BTreeMap::new())
    }

    /// Reads YAML.
    ///
    /// # Errors
    /// When the text is no YAML.
    pub fn from_yaml(text: &str) -> Result<Self, YamlError> {
        yaml::read(text)
    }

    /// The value at a place as errors name it: dotted, with the places of lists in brackets.
    #[must_use]
    pub fn at(&self, place: &str) -> Option<&Self> {
        let places = place.replace('[', ".[");
        places.split('.').try_fold(self, |tree, key| match tree {
            Self::Map(map) => map.get(key),
            Self::List(values) => {
                let index = key.strip_prefix('[')?.strip_suffix(']')?;
                values.get(index.parse::<usize>().ok()?)
            }
            _ => None,
        })
    }

    /// The value under a dotted name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Self> {
        name.split('.').try_fold(self, |tree, key| match tree {
            Self::Map(map) => map.get(key),
            _ => None,
        })
    }

    /// Puts a value under a dotted name; maps are merged, everything else is replaced.
    pub fn insert(&mut self, name: &str, value: Self) {
        let (key, rest) = match name.split_once('.') {
            Some((key, rest)) => (key, Some(rest)),
            None => (name, None),
        };
        if !matches!(self, Self::Map(_)) {
            *self = Self::empty();
        }
        let Self::Map(map) = self else { return };
        match (rest, value) {
            (Some(rest), value) => {
                map.entry(key.to_owned())
                    .or_insert_with(Self::empty)
                    .insert(rest, value);
            }
            (None, Self::Map(entries)) => {
                let below = map.entry(key.to_owned()).or_insert_with(Self::empty);
                if entries.is_empty() && !matches!(below, Self::Map(_)) {
                    *below = Self::empty();
                }
                for (key, value) in entries {
                    below.insert(&key, value);
                }
            }
            (None, value) => {
                map.insert(key.to_owned(), value);
            }
        }
    }

    /// Takes the value under a key of the top level out.
    pub fn remove(&mut self, key: &str) -> Option<Self> {
        match self {
            Self::Map(map) => map.remove(key),
            _ => None,
        }
    }

    /// Every value that is not a map, by dotted name, in order.
    #[must_use]
    pub fn leaves(&self) -> Vec<(String, &Self)> {
        fn walk<'t>(tree: &'t Tree, name: &str, leaves: &mut Vec<(String, &'t Tree)>) {
            match tree {
                Tree::Map(map) => {
                    for (key, below) in map {
                        let name = if name.is_empty() {
                            key.clone()
                        } else {
                            format!("{name}.{key}")
                        };
                        walk(below, &name, leaves);
                    }
                }
                leaf => leaves.push((name.to_owned(), leaf)),
            }
        }
        let mut leaves = Vec::new();
        walk(self, "", &mut leaves);
        leaves
    }
}

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TreeVisitor)
    }
}

struct TreeVisitor;

impl<'de> Visitor<'de> for TreeVisitor {
    type Value = Tree;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a parameter value")
    }

    fn visit_unit<E>(self) -> Result<Tree, E> {
        Ok(Tree::Null)
    }

    fn visit_none<E>(self) -> Result<Tree, E> {
        Ok(Tree::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Tree, D::Error> {
        deserializer.deserialize_any(self)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Tree, E> {
        Ok(Tree::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Tree, E> {
        Ok(Tree::Integer(value))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Tree, E> {
        i64::try_from(value)
            .map(Tree::Integer)
            .map_err(|_| E::custom(format!("integer {value} exceeds {}", i64::MAX)))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Tree, E> {
        Ok(Tree::Double(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Tree, E> {
        Ok(Tree::String(value.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Tree, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = access.next_element()? {
            values.push(value);
        }
        Ok(Tree::List(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Tree, A::Error> {
        let mut tree = Tree::empty();
        while let Some((key, value)) = access.next_entry::<String, Tree>()? {
            tree.insert(&key, value);
        }
        Ok(tree)
    }
}

/// What is wrong with a tree, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.reason())]
pub struct TreeError {
    /// Keys from the place of the error outwards.
    path: Vec<String>,
    flaw: Flaw,
}

/// What is wrong.
#[derive(Clone, Debug, PartialEq)]
enum Flaw {
    /// In words.
    Other(String),
    /// Something else belongs there, as serde names it, or a list of another length than this one.
    Kind(String, Option<usize>),
}

impl TreeError {
    /// Dotted name of the place; list places in brackets.
    #[must_use]
    pub fn place(&self) -> String {
        let mut place = String::new();
        for key in self.path.iter().rev() {
            if !place.is_empty() && !key.starts_with('[') {
                place.push('.');
            }
            place.push_str(key);
        }
        place
    }

    /// What is wrong there, and what belongs there in which unit.
    #[must_use]
    pub fn reason(&self) -> String {
        match &self.flaw {
            Flaw::Other(words) => words.clone(),
            Flaw::Kind(expected, length) => {
                let wanted = yaml::wanted(expected, &self.place());
                let has = length.map_or_else(String::new, |length| format!(", and has {length}"));
                format!("must be {wanted}{has}")
            }
        }
    }

    fn under(mut self, key: String) -> Self {
        self.path.push(key);
        self
    }

    fn new(flaw: Flaw) -> Self {
        Self {
            path: Vec::new(),
            flaw,
        }
    }
}

impl de::Error for TreeError {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self::new(Flaw::Other(message.to_string()))
    }

    // What stands there instead is shown with the parameter.
    fn invalid_type(_: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::new(Flaw::Kind(expected.to_string(), None))
    }

    fn invalid_value(_: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::new(Flaw::Kind(expected.to_string(), None))
    }

    fn invalid_length(length: usize, expected: &dyn de::Expected) -> Self {
        Self::new(Flaw::Kind(expected.to_string(), Some(length)))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let known = expected.join(", ");
        Self::custom(format!(
            "\"{variant}\" is not known here: must be one of {known}"
        ))
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        Self::custom(yaml::known_keys(field, expected))
    }

    fn missing_field(field: &'static str) -> Self {
        let unit = unit_of(field).map_or_else(String::new, |unit| format!(", in {unit}"));
        Self::custom(format!("the parameter `{field}` is missing: add it{unit}"))
    }

    fn duplicate_field(field: &'static str) -> Self {
        Self::custom(format!("`{field}` is there twice: keep one of them"))
    }
}

/// Reads a `T` out of a tree.
///
/// # Errors
/// Names the place, what stands there and what should.
pub fn read<T: de::DeserializeOwned>(tree: &Tree) -> Result<T, TreeError> {
    T::deserialize(tree)
}

impl<'de> IntoDeserializer<'de, TreeError> for &'de Tree {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

macro_rules! refuse_integer {
    ($($method:ident)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, TreeError> {
            match self {
                Tree::Integer(value) => Err(de::Error::custom(format!(
                    "expected a double, got the integer {value}: write {value}.0"
                ))),
                _ => self.deserialize_any(visitor),
            }
        }
    )*};
}

impl<'de> Deserializer<'de> for &'de Tree {
    type Error = TreeError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, TreeError> {
        match self {
            Tree::Null => visitor.visit_unit(),
            Tree::Bool(value) => visitor.visit_bool(*value),
            Tree::Integer(value) => visitor.visit_i64(*value),
            Tree::Double(value) => visitor.visit_f64(*value),
            Tree::String(value) => visitor.visit_borrowed_str(value),
            Tree::List(values) => visitor.visit_seq(Elements {
                values: values.iter().enumerate(),
            }),
            Tree::Map(map) => visitor.visit_map(Entries {
                entries: map.iter(),
                value: None,
            }),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, TreeError> {
        match self {
            Tree::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, TreeError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, TreeError> {
        let must = || {
            let known = variants.join(", ");
            Err(de::Error::custom(format!("must be one of {known}")))
        };
        match self {
            Tree::String(variant) => visitor.visit_enum(Variant {
                name: variant,
                value: None,
            }),
            Tree::Map(map) => match map.iter().next() {
                Some((name, value)) if map.len() == 1 => visitor.visit_enum(Variant {
                    name,
                    value: Some(value),
                }),
                _ => must(),
            },
            _ => must(),
        }
    }

    refuse_integer! { deserialize_f32 deserialize_f64 }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

struct Elements<'t> {
    values: std::iter::Enumerate<std::slice::Iter<'t, Tree>>,
}

impl<'t> SeqAccess<'t> for Elements<'t> {
    type Error = TreeError;

    fn next_element_seed<S: DeserializeSeed<'t>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, TreeError> {
        self.values
            .next()
            .map(|(idx, value)| {
                seed.deserialize(value)
                    .map_err(|e| e.under(format!("[{idx}]")))
            })
            .transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.values.len())
    }
}

struct Entries<'t> {
    entries: std::collections::btree_map::Iter<'t, String, Tree>,
    value: Option<(&'t String, &'t Tree)>,
}

impl<'t> MapAccess<'t> for Entries<'t> {
    type Error = TreeError;

    fn next_key_seed<K: DeserializeSeed<'t>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, TreeError> {
        self.value = self.entries.next();
        self.value
            .map(|(key, _)| {
                let key_deserializer: StrDeserializer<'_, TreeError> =
                    key.as_str().into_deserializer();
                seed.deserialize(key_deserializer)
                    .map_err(|e| e.under(key.clone()))
            })
            .transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'t>>(&mut self, seed: V) -> Result<V::Value, TreeError> {
        let (key, value) = self.value.take().ok_or_else(|| {
            <TreeError as de::Error>::custom("a value was asked for before its key")
        })?;
        seed.deserialize(value)
            .map_err(|error| error.under(key.clone()))
    }
}

struct Variant<'t> {
    name: &'t String,
    value: Option<&'t Tree>,
}

impl<'t> EnumAccess<'t> for Variant<'t> {
    type Error = TreeError;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'t>>(self, seed: S) -> Result<(S::Value, Self), TreeError> {
        let name: StrDeserializer<'_, TreeError> = self.name.as_str().into_deserializer();
        Ok((seed.deserialize(name)?, self))
    }
}

impl<'t> VariantAccess<'t> for Variant<'t> {
    type Error = TreeError;

    fn unit_variant(self) -> Result<(), TreeError> {
        match self.value {
            None | Some(Tree::Null) => Ok(()),
            Some(value) => Err(de::Error::custom(format!("expected nothing, got {value}"))),
        }
    }

    fn newtype_variant_seed<S: DeserializeSeed<'t>>(self, seed: S) -> Result<S::Value, TreeError> {
        seed.deserialize(self.value.unwrap_or(&Tree::Null))
            .map_err(|error| error.under(self.name.clone()))
    }

    fn tuple_variant<V: Visitor<'t>>(self, _: usize, visitor: V) -> Result<V::Value, TreeError> {
        self.value
            .unwrap_or(&Tree::Null)
            .deserialize_any(visitor)
            .map_err(|error| error.under(self.name.clone()))
    }

    fn struct_variant<V: Visitor<'t>>(
        self,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, TreeError> {
        match self.value {
            Some(Tree::Map(map)) => {
                let entries = Entries {
                    entries: map.iter(),
                    value: None,
                };
                visitor
                    .visit_map(entries)
                    .map_err(|error| error.under(self.name.clone()))
            }
            None => {
                let none: MapDeserializer<'_, _, TreeError> =
                    MapDeserializer::new(std::iter::empty::<(&str, &str)>());
                MapAccessDeserializer::new(none).deserialize_any(visitor)
            }
            Some(other) => Err(de::Error::custom(format!("expected keys, got {other}"))),
        }
    }
}

#[cfg(test)]
mod tests;
