//! A log that is read as a shift, with what it lacks of it.

use metrology::Axis;
use metrology::sample::Quantity;
use metrology::stamp::{Host, Machine, Span, Stamp};

use super::{Bin, Cutter, DoubtfulSpeed, Event, Piece, ShiftOrder, event};
use crate::account::Account;
use crate::condition::words;
use crate::error::BridgeError;
use crate::leap::Leap;
use crate::logged::moment;
use crate::mapping::{Mapping, Use};
use crate::observation::{MachineClock, MachineTime, Observation, Told};
use crate::pacing::{DISORDER, Moment, Pacing, Timed, first_date};
use crate::shdr::block::records;
use crate::shdr::{self, Line};
use crate::text;

/// A longer pause counts as a leap of the machine's clock.
const LONGEST_PAUSE: Span = Span::from_nanos(43_200_000_000_000);

/// A span without a line that is worth a word, s: a machine at work changes something every few seconds.
const MIN_SILENCE_S: f64 = 120.0;
/// Such spans that are kept.
const MOST_SILENT: usize = 1_000;

/// The part of a log that was asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shift {
    /// What happened, line by line of the programs.
    pub bins: Vec<Bin>,
    /// What of the log was taken and left out.
    pub account: Account,
    /// Spans of the requested range that the log covers.
    pub covered: Vec<(Stamp<Machine>, Stamp<Machine>)>,
    /// Leaps of the machine's clock over an instant that was asked for.
    pub leaps: Vec<Leap>,
    /// Readings of the spindle that are far above the others, and count.
    pub doubtful: Vec<DoubtfulSpeed>,
    /// Spans of the range in which the log does not say how fast the spindle turns: it stands in the programs.
    pub without_spindle: Vec<(Stamp<Machine>, Stamp<Machine>)>,
    /// The same of the position of each axis that the mapping has: it rests in the programs.
    pub without_position: Vec<(Axis, Vec<Piece>)>,
    /// Positions of the mapping that the programs do not follow: of several axes at once, and of rotary axes.
    pub not_followed: Vec<String>,
    /// Spans of the range, longer than a line of the programs, in which the log has no line: its last values hold.
    pub silent: Vec<(Stamp<Machine>, Stamp<Machine>)>,
    /// Whether the log reaches over the whole range.
    pub is_covered: bool,
    /// Whether nothing is missing that would change the programs.
    pub is_whole: bool,
}

/// A log that is read.
struct Reader<'a> {
    order: &'a ShiftOrder,
    mapping: &'a Mapping,
    cutter: Cutter,
    clock: MachineClock,
    account: Account,
    /// First and last instant of each piece of the log between two leaps.
    pieces: Vec<(Stamp<Machine>, Stamp<Machine>)>,
    /// Numbers of the spindle and the axes up to the order's end.
    numbers: u64,
    /// The first stamp that is a number and no date, ms.
    first_count_ms: Option<f64>,
    silent: Vec<(Stamp<Machine>, Stamp<Machine>)>,
}

impl Reader<'_> {
    fn take(&mut self, observation: Observation, dated: Option<Stamp<Machine>>, line: usize) {
        let time = match (observation.time, dated) {
            (MachineTime::Absent, Some(dated)) => MachineTime::Absolute(dated),
            (time, _) => time,
        };
        if time == MachineTime::Absent {
            return self.account.leave("values without a time", line);
        }
        if let MachineTime::Relative(at_ms) = time {
            let _ = self.first_count_ms.get_or_insert(at_ms);
        }
        let at = self.clock.stamp(time, Stamp::<Host>::default());
        self.hear(at);
        match self.pieces.last_mut() {
            Some((first, last)) => (*first, *last) = ((*first).min(at), (*last).max(at)),
            None => self.pieces.push((at, at)),
        }
        let found = self.mapping.find(&observation.key, None);
        let spindle = &self.order.spindle;
        let is_refused = found.is_some_and(|(_, used)| refuses(used, spindle, &observation.told));
        match found {
            Some(_) if is_refused => self
                .account
                .leave("values that are no numbers, or none of a machine", line),
            Some((_, used)) => {
                let is_published = *used != Use::Nothing && observation.told != Told::Unavailable;
                self.account.told += u64::from(is_published);
            }
            None => self.account.pass_over(&observation.key),
        }
        // What it is instead nobody knows: the last good one is over.
        let told = if is_refused {
            &Told::Unavailable
        } else {
            &observation.told
        };
        let event = found.and_then(|(_, used)| event(used, spindle, told));
        if let Some(event) = event {
            let is_number = matches!(event, Event::Spindle(Some(_)) | Event::Axis(_, Some(_)));
            self.numbers += u64::from(is_number && at <= self.order.to);
            if !self.cutter.take(at, event) {
                self.account.leave("values of a time told before", line);
            }
        }
    }

    /// Notes the span before a line where it is a long one within the order.
    fn hear(&mut self, at: Stamp<Machine>) {
        let Some(&(_, last)) = self.pieces.last() else {
            return;
        };
        let (from, to) = (last.max(self.order.from), at.min(self.order.to));
        let least_s = self.order.bin_s.max(MIN_SILENCE_S);
        if (to - from).as_secs_f64() > least_s && self.silent.len() < MOST_SILENT {
            self.silent.push((from, to));
        }
    }

    /// The machine's clock leaps.
    fn leap(&mut self, leap: &Leap) {
        self.cutter.leap(leap.from, leap.to);
        // It may go back to where it was before.
        let goes_on = |(_, last): &(Stamp<Machine>, Stamp<Machine>)| {
            *last - DISORDER <= leap.to && leap.to <= *last + LONGEST_PAUSE
        };
        let piece = match self.pieces.iter().rposition(goes_on) {
            Some(at) => self.pieces.remove(at),
            None => (leap.to, leap.to),
        };
        self.pieces.push(piece);
    }

    /// What the log covers of the order.
    fn covered(&self) -> Vec<(Stamp<Machine>, Stamp<Machine>)> {
        let (from, to) = (self.order.from, self.order.to);
        let pieces = self.pieces.iter();
        let within = pieces.map(|(first, last)| ((*first).max(from), (*last).min(to)));
        let mut covered: Vec<_> = within.filter(|(first, last)| first < last).collect();
        covered.sort_unstable();
        covered
    }

    /// The pause of the log in which the order lies, where it lies in one.
    fn hole(&self) -> Option<(Stamp<Machine>, Stamp<Machine>)> {
        let (from, to) = (self.order.from, self.order.to);
        let ends = self.pieces.iter().map(|(_, last)| *last);
        let begins = self.pieces.iter().map(|(first, _)| *first);
        let last = ends.filter(|last| *last <= from).max();
        last.zip(begins.filter(|first| *first >= to).min())
    }

    /// Why nothing can be made of the log; `None`: something can.
    fn nothing(&self, covered: &[(Stamp<Machine>, Stamp<Machine>)]) -> Option<String> {
        let first = self.pieces.iter().map(|(first, _)| *first).min();
        let last = self.pieces.iter().map(|(_, last)| *last).max();
        let Some((first, last)) = first.zip(last) else {
            return Some("no line with a value has a date".to_owned());
        };
        let reaches = format!("it reaches from {} to {}", words(first), words(last));
        if covered.is_empty() {
            let remedy = self.first_count_ms.and_then(since_1970).unwrap_or_else(|| "correct from and to in the order, with an offset such as +01:00 where they are local times: without one they are UTC".to_owned());
            return Some(match self.hole() {
                Some((last, next)) => format!(
                    "{reaches} and has nothing from {} to {}: {remedy}",
                    words(last),
                    words(next)
                ),
                None => format!("{reaches}: {remedy}"),
            });
        }
        (self.numbers == 0).then(|| {
            format!(
                "{reaches} without a number of the spindle or an axis: correct the mapping, or take a range in which the machine is available"
            )
        })
    }
}

/// What to do about stamps without a date that count from 1970 by their size: ms, or s that were taken for ms.
fn since_1970(first_ms: f64) -> Option<String> {
    let (unit, s) = if (1e12..4.29e12).contains(&first_ms) {
        ("ms", first_ms / 1e3)
    } else if (1e9..4.29e9).contains(&first_ms) {
        ("s", first_ms)
    } else {
        return None;
    };
    let at = Stamp::<Machine>::from_nanos(Span::from_secs_f64(s).nanos());
    Some(format!(
        "its stamps are numbers without a date, {first_ms} first; as {unit} since 1970 this is {}: write the stamps as such dates",
        words(at)
    ))
}

/// Whether a value that the programs need is not a number or is out of range.
fn refuses(used: &Use, spindle: &str, told: &Told) -> bool {
    let Told::Value(text) = told else {
        return false;
    };
    let is_needed = event(used, spindle, &Told::Unavailable).is_some();
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
    is_needed && number.is_none_or(|number| used.refuses(number).is_some())
}

/// Refuses a mapping without the spindle of the order.
fn with_spindle(mapping: &Mapping, order: &ShiftOrder) -> Result<(), BridgeError> {
    let is_spindle = |used: &Use| matches!(used, Use::Number { name, quantity: Quantity::SpindleSpeed, .. } if *name == order.spindle);
    if mapping.uses().any(|(_, used)| is_spindle(used)) {
        return Ok(());
    }
    Err(BridgeError::NoSpindle {
        name: order.spindle.clone(),
    })
}

/// Cuts an adapter's log into bins; what of it could not be read is in the account.
///
/// # Errors
/// When the mapping has no such spindle, or nothing of the log lies within the order.
pub fn bins(log: &[u8], mapping: &Mapping, order: &ShiftOrder) -> Result<Shift, BridgeError> {
    with_spindle(mapping, order)?;
    let log = text::decode(log);
    let mut reader = Reader {
        order,
        mapping,
        cutter: Cutter::new(order),
        clock: MachineClock::default(),
        account: Account {
            replaced: log.replaced as u64,
            ..Account::default()
        },
        pieces: Vec::new(),
        numbers: 0,
        first_count_ms: None,
        silent: Vec::new(),
    };
    let leaps = read(&log.text, &mut reader);
    let covered = reader.covered();
    if let Some(reason) = reader.nothing(&covered) {
        return Err(BridgeError::NothingWithin {
            from: words(order.from),
            to: words(order.to),
            reason,
            account: reader.account.to_string(),
        });
    }
    reader.cutter.take(order.to, Event::Spindle(None));
    let mut without_spindle = reader.cutter.turned.missing(order.from, order.to);
    if without_spindle == [(order.from, order.to)] {
        return Err(BridgeError::SilentSpindle {
            name: order.spindle.clone(),
            from: words(order.from),
            to: words(order.to),
            account: reader.account.to_string(),
        });
    }
    let (axes, not_followed) = positions(mapping);
    let without_position = reader.cutter.without_position(&axes, order);
    // What is shorter than one line of a program cannot be seen in it.
    without_spindle.retain(|span| length_s(&[*span]) >= order.bin_s);
    let covered_s = length_s(&covered);
    let is_covered = (order.to - order.from).as_secs_f64() - covered_s < order.bin_s;
    let account = reader.account;
    let bin = Span::from_secs_f64(order.bin_s);
    let is_known =
        reader.silent.is_empty() && without_spindle.is_empty() && without_position.is_empty();
    Ok(Shift {
        doubtful: reader.cutter.speeds.doubtful(bin),
        bins: reader.cutter.bins,
        is_covered,
        is_whole: is_covered && is_known && leaps.is_empty() && account.is_whole(),
        without_spindle,
        without_position,
        not_followed,
        silent: reader.silent,
        account,
        covered,
        leaps,
    })
}

/// The axes whose positions the programs follow, and the keys of the positions that they do not.
fn positions(mapping: &Mapping) -> (Vec<Axis>, Vec<String>) {
    let (mut followed, mut others) = (vec![], vec![]);
    for (key, used) in mapping.uses() {
        let Use::Position {
            axes,
            commanded: false,
            ..
        } = used
        else {
            continue;
        };
        match axes.as_slice() {
            [axis] if axis.is_linear() => followed.push(*axis),
            _ => others.push(key.to_owned()),
        }
    }
    (followed, others)
}

/// Length of some spans together, s.
fn length_s(spans: &[(Stamp<Machine>, Stamp<Machine>)]) -> f64 {
    let lengths = spans
        .iter()
        .map(|(first, last)| (*last - *first).as_secs_f64());
    lengths.sum()
}

/// Reads all records; returns the leaps over an instant of the order.
fn read(log: &str, reader: &mut Reader<'_>) -> Vec<Leap> {
    let records = records(log);
    let moments: Vec<Moment> = records.iter().map(moment).collect();
    let timed: Vec<Timed> = moments
        .iter()
        .filter_map(|one| one.on_its_scale())
        .collect();
    let mut pacing = Pacing::default();
    pacing.begin_at(first_date(moments.iter().copied()));
    let (mut version, mut leaps, mut behind) = (1, Vec::new(), timed.as_slice());
    let (from, to) = (reader.order.from, reader.order.to);
    for (record, moment) in records.iter().zip(moments) {
        if moment.on_its_scale().is_some() {
            behind = behind.get(1..).unwrap_or_default();
        }
        let paced = pacing.pace(moment, behind.iter().copied(), LONGEST_PAUSE);
        if let Some(leap) = paced.leap {
            reader.leap(&leap);
            if leap.from.min(leap.to) < to && leap.from.max(leap.to) > from {
                let account = &mut reader.account;
                account.leave("leaps of the machine's clock", record.line);
                leaps.push(leap);
            }
        }
        let shape = |key: &str| reader.mapping.find(key, None).map(|(_, used)| used.shape());
        let reading = shdr::read(record, version, shape);
        if reading.line != Line::Empty {
            reader.account.lines += record.lines as u64;
        }
        for flaw in &reading.flaws {
            reader.account.leave(flaw.reason(), record.line);
        }
        match reading.line {
            Line::Observations(observations) => {
                for observation in observations {
                    reader.take(observation, paced.dated, record.line);
                }
            }
            Line::Version(said) => version = said,
            _ => {}
        }
    }
    leaps
}
