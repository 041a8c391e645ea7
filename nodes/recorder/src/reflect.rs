//! Reads a CDR message by its `ros2msg` definition alone.
//!
//! The definition is the text that the file carries: the root message, then each nested one behind
//! a line of 80 `=` and a line `MSG: package/Name`. The encoding is XCDR version 1: every number
//! stands at a multiple of its size, counted from behind the 4 bytes of the encapsulation header;
//! a sequence is its length and its items; a string's length counts its closing zero.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Serialize, Serializer};

/// Nested definitions deeper than this describe themselves.
const DEEPEST: usize = 32;

/// Why a definition or a message cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReflectError {
    /// The definition is absent or of another kind.
    #[error("definition is {encoding:?}, only ros2msg is read")]
    Encoding {
        /// Its kind.
        encoding: String,
    },
    /// A part of the definition is not in the message language.
    #[error("definition of {type_name}: {reason}")]
    Definition {
        /// The part.
        type_name: String,
        /// The parser's reason.
        reason: String,
    },
    /// A type is used and not defined.
    #[error("{type_name} is used and not defined")]
    Undefined {
        /// The type.
        type_name: String,
    },
    /// A type contains itself.
    #[error("{type_name} is nested deeper than {limit}")]
    Recursive {
        /// The type.
        type_name: String,
        /// The limit.
        limit: usize,
    },
    /// A primitive type that is not read.
    #[error("field {field}: type {type_name} is not read")]
    Unsupported {
        /// The field.
        field: String,
        /// Its type.
        type_name: String,
    },
    /// An encapsulation that is not plain CDR.
    #[error("encapsulation {first:#04x} {second:#04x}, only plain CDR (00 00 and 00 01) is read")]
    Encapsulation {
        /// First byte.
        first: u8,
        /// Second byte.
        second: u8,
    },
    /// The message ends inside a field.
    #[error("field {field}: the message ends at byte {at}, {needed} more are needed")]
    Short {
        /// The field.
        field: String,
        /// Where, behind the encapsulation header.
        at: usize,
        /// Bytes missing.
        needed: usize,
    },
    /// More bytes than the definition describes.
    #[error("{left} bytes are left behind the last field")]
    Left {
        /// Bytes left.
        left: usize,
    },
    /// Text that is not UTF-8.
    #[error("field {field}: not UTF-8")]
    Text {
        /// The field.
        field: String,
    },
    /// A truth value that is neither 0 nor 1.
    #[error("field {field}: truth value {value}")]
    Bool {
        /// The field.
        field: String,
        /// Its byte.
        value: u8,
    },
}

/// A decoded value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `bool`.
    Bool(bool),
    /// Signed integers.
    Int(i64),
    /// Unsigned integers, `byte` and `char`.
    Uint(u64),
    /// `float32`.
    Float32(f32),
    /// `float64`.
    Float64(f64),
    /// `string`.
    Text(String),
    /// Arrays and sequences.
    List(Vec<Value>),
    /// A nested message: field names and values in order.
    Message(Vec<(Arc<str>, Value)>),
}

/// Fields in the order of the definition. What JSON has no number for becomes the text `NaN`,
/// `Infinity` or `-Infinity`; a `float32` becomes the double of the same value.
impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Bool(value) => serializer.serialize_bool(*value),
            Self::Int(value) => serializer.serialize_i64(*value),
            Self::Uint(value) => serializer.serialize_u64(*value),
            Self::Float32(value) => Self::Float64(f64::from(*value)).serialize(serializer),
            Self::Float64(value) if value.is_finite() => serializer.serialize_f64(*value),
            Self::Float64(value) if value.is_nan() => serializer.serialize_str("NaN"),
            Self::Float64(value) if *value > 0.0 => serializer.serialize_str("Infinity"),
            Self::Float64(_) => serializer.serialize_str("-Infinity"),
            Self::Text(value) => serializer.serialize_str(value),
            Self::List(items) => serializer.collect_seq(items),
            Self::Message(fields) => {
                serializer.collect_map(fields.iter().map(|(name, value)| (&**name, value)))
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Primitive {
    Bool,
    Int(usize),
    Uint(usize),
    Float32,
    Float64,
    Text,
}

#[derive(Clone, Debug)]
enum Kind {
    Primitive(Primitive),
    Nested(Arc<Vec<Field>>),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Many {
    One,
    Fixed(usize),
    Counted,
}

#[derive(Debug)]
struct Field {
    name: Arc<str>,
    kind: Kind,
    many: Many,
}

/// Decodes messages of one type.
#[derive(Clone, Debug)]
pub struct Reflector {
    fields: Arc<Vec<Field>>,
}

impl Reflector {
    /// Reads the definition of `type_name`, e.g. `sensor_msgs/msg/Temperature`.
    ///
    /// # Errors
    /// The definition cannot be read, or is not complete.
    pub fn new(type_name: &str, encoding: &str, definition: &str) -> Result<Self, ReflectError> {
        if encoding != "ros2msg" {
            return Err(ReflectError::Encoding {
                encoding: encoding.to_owned(),
            });
        }
        let parts = parse_parts(type_name, definition)?;
        let fields = resolve(&short_name(type_name), &parts, &mut BTreeMap::new(), 0)?;
        Ok(Self { fields })
    }

    /// The first field in which the bytes of another definition are laid out otherwise, with the names of what holds it;
    /// `None`: the same bytes mean the same in both. Comments, constants and defaults are no part of the layout.
    #[must_use]
    pub fn first_difference(&self, other: &Self) -> Option<String> {
        first_difference("", &self.fields, &other.fields)
    }

    /// Decodes one message: CDR with its encapsulation header.
    ///
    /// # Errors
    /// The bytes are not what the definition describes.
    pub fn decode(&self, data: &[u8]) -> Result<Value, ReflectError> {
        let (header, body) = data.split_at_checked(4).ok_or(ReflectError::Short {
            field: String::new(),
            at: 0,
            needed: 4,
        })?;
        let little = match header[..2] {
            [0, 0] => false,
            [0, 1] => true,
            [first, second, ..] => return Err(ReflectError::Encapsulation { first, second }),
            _ => false,
        };
        let mut cdr = Cdr {
            bytes: body,
            at: 0,
            little,
        };
        let value = cdr.message(&self.fields)?;
        let left = body.len() - cdr.at;
        // Writers may pad to a multiple of 4.
        if left >= 4 {
            return Err(ReflectError::Left { left });
        }
        Ok(value)
    }
}

fn first_difference(path: &str, ours: &[Field], theirs: &[Field]) -> Option<String> {
    let place = |field: &Field| match path {
        "" => field.name.to_string(),
        path => format!("{path}.{}", field.name),
    };
    for (own, other) in ours.iter().zip(theirs) {
        let is_same = own.name == other.name && own.many == other.many;
        match (&own.kind, &other.kind) {
            (Kind::Primitive(a), Kind::Primitive(b)) if is_same && a == b => {}
            (Kind::Nested(a), Kind::Nested(b)) if is_same => {
                let inside = first_difference(&place(own), a, b);
                if inside.is_some() {
                    return inside;
                }
            }
            _ => return Some(place(own)),
        }
    }
    let more = ours.get(theirs.len()).or(theirs.get(ours.len()));
    more.map(place)
}

/// `package/Name` and its brackets of a type that says its kind, as the parts of services and actions do.
fn without_kind(type_text: &str) -> String {
    match type_text.split('/').collect::<Vec<_>>()[..] {
        [package, _, name] => format!("{package}/{name}"),
        _ => type_text.to_owned(),
    }
}

/// Field names and types of each message by short name.
type Parts = BTreeMap<String, Vec<(String, ros2msg::Type)>>;

/// `package/Name` of `package/msg/Name`.
fn short_name(type_name: &str) -> String {
    let mut words = type_name.split('/');
    let package = words.next().unwrap_or_default();
    format!("{package}/{}", words.next_back().unwrap_or_default())
}

fn parse_parts(type_name: &str, definition: &str) -> Result<Parts, ReflectError> {
    let mut parts = Parts::new();
    let mut name = short_name(type_name);
    let mut fields = Vec::new();
    let mut lines = definition.lines();
    while let Some(line) = lines.next() {
        if line.len() >= 80 && line.bytes().all(|b| b == b'=') {
            parts.insert(name, std::mem::take(&mut fields));
            let title = lines.next().unwrap_or_default();
            name = short_name(title.strip_prefix("MSG: ").unwrap_or(title).trim());
        } else {
            fields.extend(parse_line(&name, line)?);
        }
    }
    parts.insert(name, fields);
    Ok(parts)
}

/// A field, or nothing: a comment, a constant, an annotation. Default values do not matter here.
fn parse_line(message: &str, line: &str) -> Result<Option<(String, ros2msg::Type)>, ReflectError> {
    let text = line.split('#').next().unwrap_or_default().trim();
    if text.is_empty() || text.starts_with('@') {
        return Ok(None);
    }
    let wrong = |reason: String| ReflectError::Definition {
        type_name: message.to_owned(),
        reason,
    };
    let (type_text, rest) = text
        .split_once(char::is_whitespace)
        .ok_or_else(|| wrong(format!("{text:?} has no name")))?;
    let rest = rest.trim_start();
    let name_end = rest.find(|c: char| c.is_whitespace() || c == '=');
    let (name, value) = rest.split_at(name_end.unwrap_or(rest.len()));
    if value.trim_start().starts_with('=') {
        return Ok(None);
    }
    if !ros2msg::is_valid_field_name(name) {
        return Err(wrong(format!("{name:?} is no field name")));
    }
    let package = message.split('/').next();
    let parsed = ros2msg::Type::new(&without_kind(type_text), package)
        .map_err(|error| wrong(error.to_string()))?;
    Ok(Some((name.to_owned(), parsed)))
}

fn resolve(
    name: &str,
    parts: &Parts,
    known: &mut BTreeMap<String, Arc<Vec<Field>>>,
    depth: usize,
) -> Result<Arc<Vec<Field>>, ReflectError> {
    if let Some(fields) = known.get(name) {
        return Ok(Arc::clone(fields));
    }
    if depth > DEEPEST {
        return Err(ReflectError::Recursive {
            type_name: name.to_owned(),
            limit: DEEPEST,
        });
    }
    let part = parts.get(name).ok_or_else(|| ReflectError::Undefined {
        type_name: name.to_owned(),
    })?;
    let mut fields = Vec::new();
    for (field, shape) in part {
        let base = &shape.base_type;
        let kind = match &base.pkg_name {
            Some(package) => {
                let nested = format!("{package}/{}", base.type_name);
                Kind::Nested(resolve(&nested, parts, known, depth + 1)?)
            }
            None => Kind::Primitive(primitive(field, &base.type_name)?),
        };
        let many = match (shape.is_array, shape.array_size, shape.is_upper_bound) {
            (false, ..) => Many::One,
            (true, Some(size), false) => Many::Fixed(size as usize),
            (true, ..) => Many::Counted,
        };
        fields.push(Field {
            name: field.as_str().into(),
            kind,
            many,
        });
    }
    let fields = Arc::new(fields);
    known.insert(name.to_owned(), Arc::clone(&fields));
    Ok(fields)
}

fn primitive(field: &str, type_name: &str) -> Result<Primitive, ReflectError> {
    Ok(match type_name {
        "bool" => Primitive::Bool,
        "int8" => Primitive::Int(1),
        "int16" => Primitive::Int(2),
        "int32" => Primitive::Int(4),
        "int64" => Primitive::Int(8),
        "byte" | "char" | "uint8" => Primitive::Uint(1),
        "uint16" => Primitive::Uint(2),
        "uint32" => Primitive::Uint(4),
        "uint64" => Primitive::Uint(8),
        "float32" => Primitive::Float32,
        "float64" => Primitive::Float64,
        "string" => Primitive::Text,
        _ => {
            return Err(ReflectError::Unsupported {
                field: field.to_owned(),
                type_name: type_name.to_owned(),
            });
        }
    })
}

struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

impl Cdr<'_> {
    fn message(&mut self, fields: &[Field]) -> Result<Value, ReflectError> {
        if fields.is_empty() {
            // IDL has no empty structure: an empty message carries one byte.
            self.take("", 1)?;
        }
        let mut values = Vec::with_capacity(fields.len());
        for field in fields {
            values.push((Arc::clone(&field.name), self.field(field)?));
        }
        Ok(Value::Message(values))
    }

    fn field(&mut self, field: &Field) -> Result<Value, ReflectError> {
        let count = match field.many {
            Many::One => return self.one(field),
            Many::Fixed(count) => count,
            Many::Counted => self.unsigned(&field.name, 4)? as usize,
        };
        // Each item is at least a byte, so a count beyond the bytes left is a lie.
        let left = self.bytes.len() - self.at;
        if count > left {
            return Err(self.short(&field.name, count - left));
        }
        let items = (0..count).map(|_| self.one(field));
        Ok(Value::List(items.collect::<Result<_, _>>()?))
    }

    fn one(&mut self, field: &Field) -> Result<Value, ReflectError> {
        match &field.kind {
            Kind::Nested(fields) => self.message(fields),
            Kind::Primitive(primitive) => self.primitive(&field.name, *primitive),
        }
    }

    fn primitive(&mut self, field: &Arc<str>, kind: Primitive) -> Result<Value, ReflectError> {
        Ok(match kind {
            Primitive::Bool => match self.take(field, 1)?[0] {
                0 => Value::Bool(false),
                1 => Value::Bool(true),
                value => {
                    return Err(ReflectError::Bool {
                        field: field.to_string(),
                        value,
                    });
                }
            },
            Primitive::Uint(size) => Value::Uint(self.unsigned(field, size)?),
            Primitive::Int(size) => {
                let unused_bits = 64 - 8 * size as u32;
                let bits = self.unsigned(field, size)?;
                Value::Int((bits << unused_bits).cast_signed() >> unused_bits)
            }
            Primitive::Float32 => Value::Float32(f32::from_bits(self.unsigned(field, 4)? as u32)),
            Primitive::Float64 => Value::Float64(f64::from_bits(self.unsigned(field, 8)?)),
            Primitive::Text => Value::Text(self.text(field)?),
        })
    }

    fn text(&mut self, field: &Arc<str>) -> Result<String, ReflectError> {
        let length = self.unsigned(field, 4)? as usize;
        let bytes = self.take(field, length)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        let text = std::str::from_utf8(bytes).map_err(|_| ReflectError::Text {
            field: field.to_string(),
        })?;
        Ok(text.to_owned())
    }

    /// A number of `size` bytes at its own multiple.
    fn unsigned(&mut self, field: &str, size: usize) -> Result<u64, ReflectError> {
        let aligned = self.at.next_multiple_of(size);
        let padding = aligned - self.at;
        self.take(field, padding)?;
        let little = self.little;
        let bytes = self.take(field, size)?;
        let add = |sum: u64, byte: &u8| (sum << 8) | u64::from(*byte);
        Ok(if little {
            bytes.iter().rev().fold(0, add)
        } else {
            bytes.iter().fold(0, add)
        })
    }

    fn take(&mut self, field: &str, count: usize) -> Result<&[u8], ReflectError> {
        let left = self.bytes.len() - self.at;
        if count > left {
            return Err(self.short(field, count - left));
        }
        let begin = self.at;
        self.at += count;
        Ok(&self.bytes[begin..self.at])
    }

    fn short(&self, field: &str, needed: usize) -> ReflectError {
        ReflectError::Short {
            field: field.to_owned(),
            at: self.bytes.len(),
            needed,
        }
    }
}
