//! What a stranger sends: values of any form, sensible and not, and good messages with one thing changed.

use rand::Rng;
use rand::seq::IndexedRandom as _;
use rand_pcg::Pcg64Mcg;

use crate::form::{Form, Value, Writer};

const FLOATS: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-3,
    0.25,
    5e-324,
    f64::MIN_POSITIVE,
    f64::EPSILON,
    1e-30,
    1e9,
    -1e9,
    1e18,
    1e19,
    -1e19,
    1e150,
    -1e150,
    f64::MAX,
    f64::MIN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    9.007_199_254_740_993e15,
    1.797e305,
];
const SECONDS: [i32; 9] = [
    0,
    1,
    -1,
    i32::MIN,
    i32::MAX,
    1_709_164_800,
    2_000_000_000,
    1_000,
    2_147_483_646,
];
const NANOS: [u32; 5] = [0, 1, 999_999_999, 1_000_000_000, u32::MAX];
const TEXTS: [&str; 14] = [
    "",
    " ",
    "X",
    "Y",
    "Z",
    "A",
    "x y",
    "block_1.z",
    "../../etc",
    "a\nb",
    "(",
    "G0 X1e400\nM2\n",
    "\u{202e}\u{0}",
    "9223372036854775808",
];
/// Elements of a list that a stranger makes long, and of one in a great while.
const LONG: usize = 3_000;
const VERY_LONG: usize = 100_000;

/// Draws values; holds the words that good messages use.
pub struct Dice {
    pub rng: Pcg64Mcg,
    /// Texts that somebody means something by.
    pub words: Vec<Vec<u8>>,
}

impl Dice {
    pub fn one_in(&mut self, n: u32) -> bool {
        self.rng.random_ratio(1, n)
    }

    fn float(&mut self) -> f64 {
        match self.rng.random_range(0..4) {
            0 => *FLOATS.choose(&mut self.rng).unwrap(),
            1 => self.rng.random_range(-1.0..1.0),
            2 => f64::from_bits(self.rng.random()),
            _ => self.rng.random_range(-1e-4..1e-4),
        }
    }

    fn integer(&mut self, bytes: usize, signed: bool) -> i128 {
        let bits = 8 * u32::try_from(bytes).unwrap();
        let least = if signed { -(1_i128 << (bits - 1)) } else { 0 };
        let greatest = if signed {
            (1_i128 << (bits - 1)) - 1
        } else {
            (1_i128 << bits) - 1
        };
        match self.rng.random_range(0..4) {
            0 => *[least, greatest, greatest - 1, 0, 1]
                .choose(&mut self.rng)
                .unwrap(),
            1 => i128::from(self.rng.random::<u64>()).clamp(least, greatest),
            _ => self.rng.random_range(0..12_i128),
        }
    }

    fn text(&mut self) -> Vec<u8> {
        match self.rng.random_range(0..12) {
            0..=5 if !self.words.is_empty() => self.words.choose(&mut self.rng).unwrap().clone(),
            6 if self.one_in(40) => vec![b'x'; self.rng.random_range(1_000..1_000_000)],
            6 => vec![b'Y'; self.rng.random_range(1..400)],
            7 => (0..self.rng.random_range(0..40))
                .map(|_| self.rng.random())
                .collect(),
            _ => TEXTS.choose(&mut self.rng).unwrap().as_bytes().to_vec(),
        }
    }

    fn time(&mut self, around_s: i32) -> Value {
        let sec = match self.rng.random_range(0..4) {
            0 => *SECONDS.choose(&mut self.rng).unwrap(),
            1 => self.rng.random(),
            2 => around_s.saturating_add(self.rng.random_range(-100_000..100_000)),
            _ => around_s.saturating_add(self.rng.random_range(-3..4)),
        };
        let nanosec = if self.one_in(3) {
            *NANOS.choose(&mut self.rng).unwrap()
        } else {
            self.rng.random_range(0..1_000_000_000)
        };
        Value::Time(sec, nanosec)
    }

    fn len(&mut self) -> usize {
        match self.rng.random_range(0..400) {
            0 if self.one_in(20) => self.rng.random_range(0..VERY_LONG),
            0..=1 => self.rng.random_range(0..LONG),
            2..=60 => 0,
            61..=200 => 3,
            _ => self.rng.random_range(0..9),
        }
    }

    /// Any value of `form`; stamps lie around the present as often as not.
    pub fn value(&mut self, form: &Form, around_s: i32) -> Value {
        match form {
            Form::Integer { bytes, signed } => Value::Integer(self.integer(*bytes, *signed)),
            Form::Float { .. } => Value::Float(self.float()),
            Form::Bool => Value::Bool(if self.one_in(20) {
                self.rng.random()
            } else {
                self.rng.random_range(0..2)
            }),
            Form::Text => Value::Text(self.text()),
            Form::Time => self.time(around_s),
            Form::Struct(forms) => Value::Struct(
                forms
                    .iter()
                    .map(|form| self.value(form, around_s))
                    .collect(),
            ),
            Form::Array(form, n) => {
                Value::List((0..*n).map(|_| self.value(form, around_s)).collect())
            }
            Form::List(form) => {
                let n = self.len();
                // A long list is of one value, or drawing it would take longer than what is tried.
                if n > 100 {
                    return Value::List(vec![self.value(form, around_s); n]);
                }
                Value::List((0..n).map(|_| self.value(form, around_s)).collect())
            }
        }
    }

    /// Changes one thing of a good message, or a few.
    pub fn change(&mut self, form: &Form, value: &mut Value, around_s: i32) {
        match (form, &mut *value) {
            (Form::Struct(forms), Value::Struct(values)) if !values.is_empty() => {
                let at = self.rng.random_range(0..values.len());
                self.change(&forms[at], &mut values[at], around_s);
            }
            (Form::Array(of, _), Value::List(values)) if !values.is_empty() => {
                let at = self.rng.random_range(0..values.len());
                self.change(of, &mut values[at], around_s);
            }
            (Form::List(of), Value::List(values)) => self.change_list(of, values, around_s),
            // By a little: a number that jumps, a length that is off, a stamp that is late.
            (Form::Integer { .. }, Value::Integer(n)) if self.one_in(2) => {
                *n += self.rng.random_range(-3..1_000_i128);
            }
            (Form::Float { .. }, Value::Float(x)) if self.one_in(2) => {
                *x *= *[-1.0, 1.01, 10.0, 1e3, 1e6].choose(&mut self.rng).unwrap();
            }
            (Form::Time, Value::Time(sec, _)) if self.one_in(2) => {
                *sec = sec.saturating_add(self.rng.random_range(-90_000..90_000));
            }
            (Form::Text, Value::Text(text)) if self.one_in(3) => {
                let at = self.rng.random_range(0..=text.len());
                text.insert(at, *b"\0 9.GX(\xff".choose(&mut self.rng).unwrap());
            }
            _ => *value = self.value(form, around_s),
        }
    }

    fn change_list(&mut self, of: &Form, values: &mut Vec<Value>, around_s: i32) {
        let at = self.rng.random_range(0..=values.len());
        match self.rng.random_range(0..8) {
            0 => values.truncate(at),
            1 => values.insert(at, self.value(of, around_s)),
            2 if at < values.len() => {
                let again = values[at].clone();
                values.insert(at, again);
            }
            3 if at < values.len() => {
                let n = self.len();
                let again = values[at].clone();
                values.resize(values.len() + n, again);
            }
            _ if at < values.len() => self.change(of, &mut values[at], around_s),
            _ => values.push(self.value(of, around_s)),
        }
    }

    /// The bytes of a value; now and then cut, lengthened or with a byte turned over.
    pub fn bytes(&mut self, form: &Form, value: &Value) -> Vec<u8> {
        let mut bytes = Writer::message(form, value);
        if self.one_in(30) {
            match self.rng.random_range(0..3) {
                0 => bytes.truncate(self.rng.random_range(0..=bytes.len())),
                1 => bytes.extend_from_slice(&[0xff; 7]),
                _ => {
                    let at = self.rng.random_range(0..bytes.len());
                    bytes[at] = self.rng.random();
                }
            }
        }
        bytes
    }
}
