//! A logged shift as part programs: another machine turns its spindle and moves its axes as this one did.
//!
//! The log is cut into equal times, each of which becomes one line or a few:
//!
//! ```text
//!   n     = ∫ n(t) dt / Δ                      speed of the spindle                            (1)
//!   d_i   = Σ |p_i,k − p_i,k−1|                travel of axis i                                (2)
//!   F     = √(d_X² + d_Y² + d_Z²) / Δ          feed                                            (3)
//! ```
//!
//! A value holds until the next one. A time that a log has twice, since its clock goes back, counts as it came first, so
//! that (1) is never above the greatest reading. A spindle that is absent is taken to stand, an axis that is absent not to
//! move. Short readings of the spindle far above the others are named ([`DoubtfulSpeed`]). Each axis goes its travel to and fro within a window of the other machine, so heat from nuts, guides and
//! motors comes in as it did; where the axis stood is not followed. Nothing moves: a dwell.
//!
//! # Holds when
//! Speeds last longer than Δ: heat grows faster than speed, and (1) takes the mean.
//!
//! # Agreement
//! `val_nist_the_programs_of_the_shift_have_its_turns_and_travels`: four hours of a log, summed by another program, have
//! 479,879 turns and travels of 80,172, 6,071 and 29,979 mm; the programs agree within 6e-6 of each, and last 14,400.2 s.

use metrology::sample::Quantity;
use metrology::stamp::{Machine, Span, Stamp};
use metrology::{Axis, PerAxis};

use crate::error::BridgeError;
use crate::mapping::Use;
use crate::observation::Told;

mod doubtful;
mod once;
mod reading;
#[cfg(test)]
mod tests;

pub use doubtful::DoubtfulSpeed;
use doubtful::Speeds;
use once::{Once, Piece};
pub use reading::{Shift, bins};

/// A spindle that turns more slowly than this stands, 1/s.
const STANDS_RAD_S: f64 = 1.0;
/// One rad/s in 1/min.
const RPM: f64 = 30.0 / std::f64::consts::PI;
/// A travel below this is none, mm: dither at rest.
const REST_MM: f64 = 0.01;
/// Greatest travel of one line over the window's length.
const WINDOW_SHARE: f64 = 0.5;

/// Lines of all programs together: what a control takes in one.
const LINE_LIMIT: u32 = 1_000_000;

/// What is asked of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct ShiftOrder {
    /// First instant.
    pub from: Stamp<Machine>,
    /// Last instant.
    pub to: Stamp<Machine>,
    /// Time of one line, s.
    pub bin_s: f64,
    /// Time of one program, s.
    pub slice_s: f64,
    /// Which spindle: name of its value in the mapping.
    pub spindle: String,
    /// Least and greatest position of X, Y and Z on the other machine, mm.
    pub window_mm: PerAxis<(f64, f64)>,
    /// Height at which a program begins and ends, mm.
    pub clear_mm: f64,
    /// Greatest feed of the other machine, mm/s.
    pub feed_limit_mm_s: f64,
    /// Greatest speed of the other machine's spindle, 1/min; 0: it has none.
    pub spindle_limit_rpm: f64,
}

impl ShiftOrder {
    /// Its length in lines of programs.
    #[must_use]
    pub fn bins(&self) -> f64 {
        let length_s = (self.to - self.from).as_secs_f64();
        (length_s / self.bin_s).round().max(0.0)
    }

    /// Pieces into which the travel of a bin is cut, so that no axis leaves its window.
    fn pieces(&self, travel_mm: &PerAxis<f64>) -> f64 {
        let parts = Axis::LINEAR.map(|axis| {
            let (low, high) = self.window_mm[axis];
            (travel_mm[axis] / ((high - low) * WINDOW_SHARE))
                .ceil()
                .max(1.0)
        });
        parts.into_iter().fold(1.0, f64::max)
    }
}

/// What happened in one bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// (1), rad/s.
    pub spindle_rad_s: f64,
    /// (2), mm.
    pub travel_mm: PerAxis<f64>,
}

impl Bin {
    /// Whole turns in a minute; 0: it stands.
    fn rpm(&self) -> i64 {
        if self.spindle_rad_s < STANDS_RAD_S {
            return 0;
        }
        (self.spindle_rad_s * RPM).round() as i64
    }
}

/// One value of the log that matters here.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Event {
    Spindle(Option<f64>),
    Axis(Axis, Option<f64>),
}

/// A log as bins.
#[derive(Debug)]
struct Cutter {
    bin: Span,
    from: Stamp<Machine>,
    bins: Vec<Bin>,
    spindle: Option<(Stamp<Machine>, f64)>,
    position_mm: PerAxis<Option<f64>>,
    /// Time of the last position of each axis; `None`: not since the clock leapt.
    axis_told: PerAxis<Option<Stamp<Machine>>>,
    /// Times of which the log has the spindle, and each axis.
    turned: Once,
    travelled: PerAxis<Once>,
    /// Times of which the log has where each axis is.
    placed: PerAxis<Once>,
    /// Readings of the spindle within the order.
    speeds: Speeds,
}

impl Cutter {
    /// Of an order whose number of bins is bounded.
    fn new(order: &ShiftOrder) -> Self {
        let n = order.bins();
        Self {
            bin: Span::from_secs_f64(order.bin_s),
            from: order.from,
            bins: vec![Bin::default(); n as usize],
            spindle: None,
            position_mm: PerAxis::default(),
            axis_told: PerAxis::default(),
            turned: Once::default(),
            travelled: PerAxis::from_fn(|_| Once::default()),
            placed: PerAxis::from_fn(|_| Once::default()),
            speeds: Speeds::default(),
        }
    }

    fn place(&self, at: Stamp<Machine>) -> Option<usize> {
        let since = (at - self.from).nanos();
        usize::try_from(since.div_euclid(self.bin.nanos())).ok()
    }

    /// (1) of a speed that held from one instant to another.
    fn turn(&mut self, from: Stamp<Machine>, to: Stamp<Machine>, speed_rad_s: f64) {
        let first = self.place(from.max(self.from)).unwrap_or_default();
        if first < self.bins.len() {
            self.speeds.add((from, to), speed_rad_s * RPM, first);
        }
        let last = self.place(to).map_or(0, |last| last.saturating_add(1));
        let bins = self.bins.iter_mut().enumerate().take(last);
        for (at, bin) in bins.skip(first) {
            let offset = self
                .bin
                .nanos()
                .saturating_mul(i64::try_from(at).unwrap_or(i64::MAX));
            let begin = self.from + Span::from_nanos(offset);
            let (first, last) = (from.max(begin), to.min(begin + self.bin));
            if last > first {
                let share = (last - first).as_secs_f64() / self.bin.as_secs_f64();
                bin.spindle_rad_s += speed_rad_s * share;
            }
        }
    }

    /// Whether all of it is new: nothing of a time that the log had before.
    fn take(&mut self, at: Stamp<Machine>, event: Event) -> bool {
        match event {
            Event::Spindle(speed_rad_s) => {
                let now = speed_rad_s.map(|speed_rad_s| (at, speed_rad_s));
                let Some((since, before_rad_s)) = std::mem::replace(&mut self.spindle, now) else {
                    return true;
                };
                let new = self.turned.tell(since, at);
                for (first, last) in &new {
                    self.turn(*first, *last, before_rad_s);
                }
                at == since || new == [(since, at)]
            }
            Event::Axis(axis, position_mm) => {
                let before = std::mem::replace(&mut self.position_mm[axis], position_mm);
                let travel_mm = position_mm
                    .zip(before)
                    .map(|(now, before)| (now - before).abs());
                let is_new = !self.travelled[axis].has(at);
                if let Some(since) = self.axis_told[axis].replace(at) {
                    self.travelled[axis].tell(since, at);
                    if before.is_some() {
                        self.placed[axis].tell(since, at);
                    }
                }
                let bin = self.place(at).and_then(|place| self.bins.get_mut(place));
                if let (Some(bin), Some(travel_mm), true) = (bin, travel_mm, is_new) {
                    bin.travel_mm[axis] += travel_mm;
                }
                is_new
            }
        }
    }

    /// Spans of an order, of a line of a program at least, in which the log does not say where an axis is.
    fn unplaced(&mut self, axis: Axis, order: &ShiftOrder) -> Vec<Piece> {
        if let (Some(since), Some(_)) = (self.axis_told[axis], self.position_mm[axis]) {
            self.placed[axis].tell(since, order.to);
        }
        let mut missing = self.placed[axis].missing(order.from, order.to);
        missing.retain(|(from, to)| (*to - *from).as_secs_f64() >= order.bin_s);
        missing
    }

    /// The same of several axes; those that have none are left out.
    fn without_position(&mut self, axes: &[Axis], order: &ShiftOrder) -> Vec<(Axis, Vec<Piece>)> {
        let missing = axes.iter().map(|axis| (*axis, self.unplaced(*axis, order)));
        missing.filter(|(_, spans)| !spans.is_empty()).collect()
    }

    /// The clock leaps: a speed holds to the last stamp before it, and from the first one behind it.
    fn leap(&mut self, from: Stamp<Machine>, to: Stamp<Machine>) {
        self.axis_told = PerAxis::default();
        if let Some((_, speed_rad_s)) = self.spindle {
            self.take(from, Event::Spindle(None));
            self.spindle = Some((to, speed_rad_s));
        }
    }
}

fn number(told: &Told) -> Option<Option<f64>> {
    match told {
        Told::Unavailable => Some(None),
        Told::Value(text) => {
            let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
            number.map(Some)
        }
        Told::Series { .. } | Told::Alarm(_) => None,
    }
}

fn event(used: &Use, spindle: &str, told: &Told) -> Option<Event> {
    let number = number(told)?;
    match used {
        Use::Number {
            name,
            quantity: Quantity::SpindleSpeed,
            to_inner,
            ..
        } if name == spindle => Some(Event::Spindle(number.map(|n| n.abs() * to_inner.0))),
        Use::Position {
            axes,
            commanded: false,
            factor,
        } => match axes.as_slice() {
            [axis] if axis.is_linear() => Some(Event::Axis(*axis, number.map(|n| n * factor))),
            _ => None,
        },
        _ => None,
    }
}

/// Writes programs.
#[derive(Debug)]
struct Writer<'a> {
    order: &'a ShiftOrder,
    text: String,
    at_mm: PerAxis<f64>,
    rpm: i64,
}

impl Writer<'_> {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn begin(&mut self, title: &str) {
        let order = self.order;
        self.at_mm = PerAxis::from_fn(|axis| {
            let (low, high) = order.window_mm[axis];
            round((low + high) / 2.0)
        });
        let [x, y, z] = Axis::LINEAR.map(|axis| self.at_mm[axis]);
        self.text = format!(
            "(frame: machine) ({title})\nG21 G90 G17\nG0 Z{}\nG0 X{x} Y{y}\nG0 Z{z}\n",
            order.clear_mm
        );
        self.rpm = 0;
    }

    fn end(&mut self) {
        let clear = format!("G0 Z{}", self.order.clear_mm);
        self.line(&clear);
        if self.rpm != 0 {
            self.line("M5");
        }
        self.line("M2");
    }

    fn bin(&mut self, bin: &Bin) {
        let rpm = bin.rpm();
        if rpm != self.rpm {
            let line = if rpm == 0 {
                "M5".to_owned()
            } else {
                format!("S{rpm} M3")
            };
            self.line(&line);
            self.rpm = rpm;
        }
        let travel_mm = PerAxis::from_fn(|axis| {
            let travel_mm = bin.travel_mm[axis];
            if travel_mm < REST_MM { 0.0 } else { travel_mm }
        });
        if travel_mm.xyz().norm() > 0.0 {
            self.travel(&travel_mm);
        } else {
            let line = format!("G4 P{}", self.order.bin_s);
            self.line(&line);
        }
    }

    /// To and fro, so that no axis leaves its window.
    fn travel(&mut self, travel_mm: &PerAxis<f64>) {
        let order = self.order;
        let n = order.pieces(travel_mm);
        let piece_s = order.bin_s / n;
        for _ in 0..n as usize {
            let mut line = "G1".to_owned();
            let from_mm = self.at_mm;
            for axis in Axis::LINEAR {
                let step_mm = travel_mm[axis] / n;
                if step_mm == 0.0 {
                    continue;
                }
                let ahead_mm = self.at_mm[axis] + step_mm;
                let is_inside = ahead_mm <= order.window_mm[axis].1;
                let next_mm = if is_inside {
                    ahead_mm
                } else {
                    self.at_mm[axis] - step_mm
                };
                self.at_mm[axis] = round(next_mm);
                line.push_str(&format!(" {axis}{}", self.at_mm[axis]));
            }
            // Of the way as it is written: a piece lasts its time however short it is.
            let way_mm = (self.at_mm.xyz() - from_mm.xyz()).norm();
            if way_mm > 0.0 {
                line.push_str(&format!(" F{}", feed_word(way_mm / piece_s * 60.0)));
            } else {
                line = format!("G4 P{piece_s}");
            }
            self.line(&line);
        }
    }
}

/// Greatest part by which a feed, and so the time of its line, is off.
const FEED_ERROR: f64 = 1e-4;

/// A feed in mm/min with the digits that it needs, at least one decimal.
fn feed_word(feed_mm_min: f64) -> f64 {
    let rounded = (1..=9).map(|decimals| {
        let scale = 10_f64.powi(decimals);
        (feed_mm_min * scale).round() / scale
    });
    let mut near = rounded.filter(|word| (word / feed_mm_min - 1.0).abs() <= FEED_ERROR);
    near.next().unwrap_or(feed_mm_min)
}

/// To a micrometre, as programs are written.
fn round(position_mm: f64) -> f64 {
    (position_mm * 1e3).round() / 1e3
}

/// One program for each slice; the last may be shorter.
///
/// # Errors
/// When a bin needs a feed or a speed of the spindle that the other machine has not, or the travels more lines than a control takes.
pub fn programs(bins: &[Bin], title: &str, order: &ShiftOrder) -> Result<Vec<String>, BridgeError> {
    for (at, bin) in bins.iter().enumerate() {
        if bin.rpm() as f64 > order.spindle_limit_rpm {
            return Err(BridgeError::SpindleTooFast {
                at_s: at as f64 * order.bin_s,
                rpm: bin.rpm(),
                limit_rpm: order.spindle_limit_rpm,
            });
        }
        let feed_mm_s = bin.travel_mm.xyz().norm() / order.bin_s;
        if feed_mm_s > order.feed_limit_mm_s {
            return Err(BridgeError::FeedTooHigh {
                at_s: at as f64 * order.bin_s,
                feed_mm_min: feed_mm_s * 60.0,
                limit_mm_min: order.feed_limit_mm_s * 60.0,
            });
        }
    }
    let lines: f64 = bins.iter().map(|bin| order.pieces(&bin.travel_mm)).sum();
    if lines.is_nan() || lines > f64::from(LINE_LIMIT) {
        return Err(BridgeError::TooManyLines {
            lines,
            limit: LINE_LIMIT,
        });
    }
    let per_slice = (order.slice_s / order.bin_s).round().max(1.0) as usize;
    let mut writer = Writer {
        order,
        text: String::new(),
        at_mm: PerAxis::default(),
        rpm: 0,
    };
    let slices = bins.chunks(per_slice).enumerate();
    Ok(slices
        .map(|(n, slice)| {
            writer.begin(&format!("{title}, part {}", n + 1));
            for bin in slice {
                writer.bin(bin);
            }
            writer.end();
            std::mem::take(&mut writer.text)
        })
        .collect())
}
