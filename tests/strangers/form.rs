//! Messages of any type as values, by the type's parts alone: read from CDR, written to it, drawn and changed.

use abbe_msgs::parts_of;

/// What a type is made of.
#[derive(Clone, Debug)]
pub enum Form {
    /// A number of so many bytes.
    Integer {
        bytes: usize,
        signed: bool,
    },
    /// A number with a point, of 4 or 8 bytes.
    Float {
        bytes: usize,
    },
    Bool,
    Text,
    /// Seconds and nanoseconds.
    Time,
    Struct(Vec<Form>),
    Array(Box<Form>, usize),
    List(Box<Form>),
}

/// A value of a form.
#[derive(Clone, Debug)]
pub enum Value {
    Integer(i128),
    Float(f64),
    /// Any byte: a stranger's truth may be neither.
    Bool(u8),
    /// Without its end; may be no UTF-8.
    Text(Vec<u8>),
    Time(i32, u32),
    Struct(Vec<Value>),
    List(Vec<Value>),
}

const TIME: &str = "builtin_interfaces/msg/Time";
const ARRAYS: u8 = 48;
const BOUNDED: u8 = 96;

impl Form {
    /// The form of `package/kind/Name`.
    pub fn of(type_name: &str) -> Self {
        if type_name == TIME {
            return Self::Time;
        }
        let parts = parts_of(type_name).unwrap_or_else(|| panic!("{type_name}: no such type"));
        let fields = parts.fields.iter();
        Self::Struct(
            fields
                .map(|field| {
                    let id = field.type_id % ARRAYS;
                    let one = Self::basic(id, field.nested);
                    match field.type_id {
                        id if id <= ARRAYS => one,
                        id if id <= BOUNDED => {
                            let n = usize::try_from(field.capacity).unwrap();
                            Self::Array(Box::new(one), n)
                        }
                        _ => Self::List(Box::new(one)),
                    }
                })
                .collect(),
        )
    }

    fn basic(id: u8, nested: &str) -> Self {
        let integer = |bytes, signed| Self::Integer { bytes, signed };
        match id {
            1 => Self::of(nested),
            2 => integer(1, true),
            3 | 13 | 16 => integer(1, false),
            4 => integer(2, true),
            5 => integer(2, false),
            6 => integer(4, true),
            7 => integer(4, false),
            8 => integer(8, true),
            9 => integer(8, false),
            10 => Self::Float { bytes: 4 },
            11 => Self::Float { bytes: 8 },
            15 => Self::Bool,
            17 | 21 => Self::Text,
            other => panic!("field type {other}: teach it to this test"),
        }
    }
}

/// Writes plain CDR, little-endian.
pub struct Writer {
    bytes: Vec<u8>,
}

const HEADER: usize = 4;

impl Writer {
    pub fn message(form: &Form, value: &Value) -> Vec<u8> {
        let mut writer = Self {
            bytes: abbe_msgs::ENCAPSULATION.to_vec(),
        };
        writer.write(form, value);
        writer.bytes
    }

    fn number(&mut self, n_bytes: usize, le: &[u8]) {
        while !(self.bytes.len() - HEADER).is_multiple_of(n_bytes) {
            self.bytes.push(0);
        }
        self.bytes.extend_from_slice(&le[..n_bytes]);
    }

    fn length(&mut self, len: usize) {
        let len = u32::try_from(len).unwrap_or(u32::MAX);
        self.number(4, &len.to_le_bytes());
    }

    fn write(&mut self, form: &Form, value: &Value) {
        match (form, value) {
            (Form::Integer { bytes, .. }, Value::Integer(n)) => {
                self.number(*bytes, &n.to_le_bytes());
            }
            (Form::Float { bytes: 4 }, Value::Float(x)) => {
                self.number(4, &(*x as f32).to_le_bytes());
            }
            (Form::Float { .. }, Value::Float(x)) => self.number(8, &x.to_le_bytes()),
            (Form::Bool, Value::Bool(byte)) => self.bytes.push(*byte),
            (Form::Text, Value::Text(text)) => {
                self.length(text.len() + 1);
                self.bytes.extend_from_slice(text);
                self.bytes.push(0);
            }
            (Form::Time, Value::Time(sec, nanosec)) => {
                self.number(4, &sec.to_le_bytes());
                self.number(4, &nanosec.to_le_bytes());
            }
            (Form::Struct(forms), Value::Struct(values)) => {
                for (form, value) in forms.iter().zip(values) {
                    self.write(form, value);
                }
            }
            (Form::Array(form, _), Value::List(values)) => {
                values.iter().for_each(|value| self.write(form, value));
            }
            (Form::List(form), Value::List(values)) => {
                self.length(values.len());
                values.iter().for_each(|value| self.write(form, value));
            }
            _ => unreachable!("a value is made by its form"),
        }
    }
}

/// Reads plain CDR, little-endian.
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    /// The value in `bytes`; `None`: they are no such message.
    pub fn message(form: &Form, bytes: &'a [u8]) -> Option<Value> {
        let mut reader = Self {
            bytes: bytes.strip_prefix(&abbe_msgs::ENCAPSULATION)?,
            at: 0,
        };
        reader.read(form)
    }

    fn take(&mut self, n: usize, align: usize) -> Option<&'a [u8]> {
        let from = self.at.next_multiple_of(align);
        let taken = self.bytes.get(from..from + n)?;
        self.at = from + n;
        Some(taken)
    }

    fn length(&mut self) -> Option<usize> {
        let bytes = self.take(4, 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(bytes) as usize)
    }

    fn list(&mut self, form: &Form, n: usize) -> Option<Value> {
        let values: Option<Vec<Value>> = (0..n).map(|_| self.read(form)).collect();
        values.map(Value::List)
    }

    fn read(&mut self, form: &Form) -> Option<Value> {
        Some(match form {
            Form::Integer { bytes, signed } => {
                let taken = self.take(*bytes, *bytes)?;
                let is_negative = *signed && taken[*bytes - 1] & 0x80 != 0;
                let mut all = [if is_negative { 0xff } else { 0 }; 16];
                all[..*bytes].copy_from_slice(taken);
                Value::Integer(i128::from_le_bytes(all))
            }
            Form::Float { bytes: 4 } => {
                let bytes = self.take(4, 4)?.try_into().ok()?;
                Value::Float(f64::from(f32::from_le_bytes(bytes)))
            }
            Form::Float { .. } => {
                Value::Float(f64::from_le_bytes(self.take(8, 8)?.try_into().ok()?))
            }
            Form::Bool => Value::Bool(self.take(1, 1)?[0]),
            Form::Text => {
                let n = self.length()?;
                let taken = self.take(n, 1)?;
                Value::Text(taken.strip_suffix(&[0])?.to_vec())
            }
            Form::Time => {
                let sec = i32::from_le_bytes(self.take(4, 4)?.try_into().ok()?);
                let nanosec = u32::from_le_bytes(self.take(4, 4)?.try_into().ok()?);
                Value::Time(sec, nanosec)
            }
            Form::Struct(forms) => {
                let values: Option<Vec<Value>> = forms.iter().map(|form| self.read(form)).collect();
                Value::Struct(values?)
            }
            Form::Array(form, n) => self.list(form, *n)?,
            Form::List(form) => {
                let n = self.length()?;
                // Every element has at least a byte.
                if n > self.bytes.len() {
                    return None;
                }
                self.list(form, n)?
            }
        })
    }
}

impl Value {
    /// Every stamp that is one so much later, ns.
    pub fn shift(&mut self, by_nanos: i64) {
        match self {
            Self::Time(sec, nanosec) if *sec > 0 => {
                let nanos = i64::from(*sec) * 1_000_000_000 + i64::from(*nanosec) + by_nanos;
                *sec = i32::try_from(nanos.div_euclid(1_000_000_000)).unwrap_or(i32::MAX);
                *nanosec = u32::try_from(nanos.rem_euclid(1_000_000_000)).unwrap_or(0);
            }
            Self::Struct(values) | Self::List(values) => {
                values.iter_mut().for_each(|value| value.shift(by_nanos));
            }
            _ => {}
        }
    }

    /// Every text in it.
    pub fn texts(&self, found: &mut Vec<Vec<u8>>) {
        match self {
            Self::Text(text) => found.push(text.clone()),
            Self::Struct(values) | Self::List(values) => {
                values.iter().for_each(|value| value.texts(found));
            }
            _ => {}
        }
    }
}
