//! Lines of text from `halsampler -t`, one record per servo period.
//!
//! Columns, in the order in which the HAL file wires the sampler's pins: record number; position
//! commanded to each joint (mm or deg, compensation not included); position of each motor (mm or
//! deg, compensation included); position read by the linear scale of each joint that has one (mm); probe input; motion type; program line; motion enabled. The sampler
//! runs *before* motion in the servo thread: a record holds exactly what motion is about to see, and
//! the commanded positions are those which the drives have just been following. Six decimals are
//! printed: 1 nm, or 0.0036 arcsec.

use metrology::{Axis, PerAxis};

/// Longest line that is accepted.
pub const SAMPLE_LIMIT_BYTES: usize = 1024;

/// Motion type of LinuxCNC's `motion.motion-type` while a G38 moves.
pub const PROBING: i32 = 5;

/// One servo period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Counts servo periods; wraps.
    pub number: i32,
    /// Commanded, compensation not included; mm or rad.
    pub commanded: PerAxis<f64>,
    /// Where the motors are, compensation included; mm or rad.
    pub motor: PerAxis<f64>,
    /// What the linear scales read, compensation included; mm, NaN where there is none.
    pub scale: PerAxis<f64>,
    /// Probe input as motion is about to see it.
    pub probe_closed: bool,
    /// `motion.motion-type`.
    pub motion_type: i32,
    /// Line of the program whose motion is being executed, from 1; 0 where there is none.
    pub line: u32,
    /// Whether the drives are enabled.
    pub enabled: bool,
}

impl Default for Record {
    fn default() -> Self {
        Self {
            number: 0,
            commanded: PerAxis([0.0; 6]),
            motor: PerAxis([0.0; 6]),
            scale: PerAxis([f64::NAN; 6]),
            probe_closed: false,
            motion_type: 0,
            line: 0,
            enabled: false,
        }
    }
}

/// What a line says.
#[derive(Clone, Debug, PartialEq)]
pub enum SampleEvent {
    /// A record.
    Record(Record),
    /// The sampler's queue ran over here.
    Overrun,
    /// A line that is no record: its number of columns and the first that could not be read.
    Malformed {
        /// Columns in the line.
        columns: usize,
        /// Columns that a record has.
        expected: usize,
    },
}

/// Cuts the stream into records.
#[derive(Clone, Debug, Default)]
pub struct SampleReader {
    joints: Vec<Axis>,
    scales: Vec<Axis>,
    line: Vec<u8>,
    too_long: bool,
}

impl SampleReader {
    /// For a sampler of these joints, of which some have linear scales.
    #[must_use]
    pub fn new(joints: &[Axis], scales: &[Axis]) -> Self {
        Self {
            joints: joints.to_vec(),
            scales: scales.to_vec(),
            line: Vec::with_capacity(SAMPLE_LIMIT_BYTES),
            too_long: false,
        }
    }

    /// Forgets an unfinished line (the stream begins anew).
    pub fn restart(&mut self) {
        self.line.clear();
        self.too_long = false;
    }

    /// Takes bytes and passes what they say to `sink`, in order.
    pub fn receive(&mut self, bytes: &[u8], mut sink: impl FnMut(SampleEvent)) {
        for &byte in bytes {
            if byte == b'\n' {
                if self.too_long || !self.line.trim_ascii().is_empty() {
                    sink(self.read_line());
                }
                self.restart();
            } else if self.line.len() == SAMPLE_LIMIT_BYTES {
                self.too_long = true;
            } else {
                self.line.push(byte);
            }
        }
    }

    fn columns(&self) -> usize {
        2 * self.joints.len() + self.scales.len() + 5
    }

    fn read_line(&self) -> SampleEvent {
        let text = std::str::from_utf8(&self.line).unwrap_or("");
        if text.trim() == "overrun" {
            return SampleEvent::Overrun;
        }
        match self.read_record(text) {
            Some(record) if !self.too_long => SampleEvent::Record(record),
            _ => SampleEvent::Malformed {
                columns: text.split_ascii_whitespace().count(),
                expected: self.columns(),
            },
        }
    }

    fn read_record(&self, text: &str) -> Option<Record> {
        let mut words = text.split_ascii_whitespace();
        let mut record = Record {
            number: words.next()?.parse().ok()?,
            ..Record::default()
        };
        for axis in &self.joints {
            record.commanded[*axis] = position(*axis, words.next()?)?;
        }
        for axis in &self.joints {
            record.motor[*axis] = position(*axis, words.next()?)?;
        }
        for axis in &self.scales {
            record.scale[*axis] = position(*axis, words.next()?)?;
        }
        record.probe_closed = bit(words.next()?)?;
        record.motion_type = words.next()?.parse().ok()?;
        let line: i32 = words.next()?.parse().ok()?;
        record.line = u32::try_from(line.max(0)).ok()?;
        record.enabled = bit(words.next()?)?;
        words.next().is_none().then_some(record)
    }
}

/// mm as they are, deg to rad; `None` for what is not a finite number.
fn position(axis: Axis, word: &str) -> Option<f64> {
    let value: f64 = word.parse().ok()?;
    let inner = if axis.is_linear() {
        value
    } else {
        value.to_radians()
    };
    inner.is_finite().then_some(inner)
}

fn bit(word: &str) -> Option<bool> {
    match word {
        "0" => Some(false),
        "1" => Some(true),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const XC: [Axis; 2] = [Axis::X, Axis::C];

    fn check(text: &[u8]) -> Vec<SampleEvent> {
        let mut reader = SampleReader::new(&XC, &[]);
        let mut events = Vec::new();
        for chunk in text.chunks(3) {
            reader.receive(chunk, |event| events.push(event));
        }
        events
    }

    #[test]
    fn a_record_is_read_across_chunks() {
        let events = check(b"12 1.500000 180.000000 1.499000 179.000000 1 5 8 1 \n");
        let [SampleEvent::Record(record)] = events.as_slice() else {
            panic!("{events:?}")
        };
        assert_eq!((record.number, record.line, record.motion_type), (12, 8, 5));
        assert!(record.probe_closed && record.enabled);
        assert!((record.motor[Axis::X] - 1.499).abs() < 1e-12);
        assert!((record.commanded[Axis::C] - std::f64::consts::PI).abs() < 1e-12);
    }

    #[test]
    fn a_scale_is_read_behind_the_motors_and_is_no_number_where_there_is_none() {
        let mut reader = SampleReader::new(&XC, &[Axis::X]);
        let mut events = Vec::new();
        let text = b"12 1.5 180.0 1.499 179.0 1.4945 1 5 8 1\n12 1.5 180.0 1.499 179.0 1 5 8 1\n";
        reader.receive(text, |event| events.push(event));
        let [
            SampleEvent::Record(record),
            SampleEvent::Malformed { columns, expected },
        ] = events.as_slice()
        else {
            panic!("{events:?}")
        };
        assert!((record.scale[Axis::X] - 1.4945).abs() < 1e-12);
        assert!(record.scale[Axis::C].is_nan());
        assert_eq!((*columns, *expected), (9, 10));
    }

    #[test]
    fn overruns_and_rubbish_are_told_apart() {
        assert_eq!(check(b"overrun\n\n"), [SampleEvent::Overrun]);
        for bad in [
            &b"12 1.5 180.0 1.4 nan 1 5 8 1\n"[..],
            b"12 1.5 180.0 1.4 179.0 2 5 8 1\n",
            b"12 1.5 180.0 1.4 179.0 1 5 8\n",
            b"12 1.5 180.0 1.4 179.0 1 5 8 1 9\n",
            b"99999999999 1.5 180.0 1.4 179.0 1 5 8 1\n",
            b"\xff\xfe\n",
        ] {
            let events = check(bad);
            assert!(
                matches!(events.as_slice(), [SampleEvent::Malformed { .. }]),
                "{events:?}"
            );
        }
    }

    #[test]
    fn a_line_without_end_is_bounded_and_the_next_one_is_read() {
        let mut text = vec![b'7'; 5 * SAMPLE_LIMIT_BYTES];
        text.extend_from_slice(b"\n12 1.5 180.0 1.4 179.0 1 5 8 1\n");
        let events = check(&text);
        assert!(matches!(
            events.as_slice(),
            [SampleEvent::Malformed { .. }, SampleEvent::Record(_)]
        ));
    }
}
