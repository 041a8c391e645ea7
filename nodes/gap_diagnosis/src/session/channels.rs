//! Deviations of every instrument along one run, placed at the ticks of its motion.

use std::ops::Range;

use machine::MachineFile;
use metrology::sample::TestKind;
use metrology::stamp::{Host, Stamp};
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;
use twin::simulate::plate_axes;
use twin::{Channel, Motion};

use super::account::{Account, Reason};
use super::record::{Record, STANDING_S, stands};
use super::select::FULL_RATE;
use super::standing::{Standing, both, standing};
use super::thermometers;

/// Greatest distance between ticks on either side of a reading, s.
const GAP_S: f64 = 0.25;
/// Zeros that are remembered; of more the oldest is forgotten, and a run under it has one of its own.
const MOST_ZEROS: usize = 10_000;
/// Greatest distance of the path between those ticks from the parabola that is taken for it, mm or rad.
const BOW: f64 = 1e-4;
/// What an acceleration that changes evenly by 1 makes of it in a time of 1: the peak of s (1 - s) (1 - 2 s) / 12.
const OFF_PARABOLA: f64 = 0.008_02;
/// Rotary axes beyond this are turned, rad.
const TURNED_RAD: f64 = 1e-6;
/// A reading of a circle that lies nearer to a point where an axis turns round lies on it.
const ON_REVERSAL_MM: f64 = 1e-6;
/// An axis that covers less in what is judged of a run does not move, mm or rad.
const MOVES: f64 = 1e-2;

/// A deviation at a place among the ticks: index and fraction towards the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Raw {
    pub place: f64,
    pub deviation: f64,
}

/// Deviations of one channel, in time.
pub(super) type Series = (Channel, Vec<Raw>);

/// What a count of zero belongs to.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Zero {
    is_grid: bool,
    setup_id: u32,
    zero_id: u32,
    shift_mm: [f64; 2],
}

/// One run with its motion at the full rate.
pub(super) struct Scope<'a> {
    pub machine: &'a MachineFile,
    pub record: &'a Record,
    pub motion: &'a Motion,
    /// Ticks from the first to the last that is judged.
    pub judged: Range<usize>,
}

impl Scope<'_> {
    /// Every channel of the run, before anything is selected.
    pub(super) fn channels(&self, account: &mut Account) -> Vec<Series> {
        let mut all = vec![];
        if touches_only(self.record.segment.kind) {
            return all;
        }
        all.extend(self.grid(account));
        all.extend(self.length(account));
        all.extend(self.ballbar(account));
        for axis in self.motion.axes.iter().filter(|axis| self.moves(*axis)) {
            let motor = self.encoder(axis, |tick| tick.motor);
            // A motor that is its command to the last digit was not measured.
            if motor.iter().any(|raw| raw.deviation.abs() > 0.0) {
                all.push((Channel::Motor(axis), motor));
            }
            all.push((Channel::Scale(axis), self.encoder(axis, |tick| tick.scale)));
        }
        all.extend(thermometers::compared(self));
        all.retain(|(_, series)| !series.is_empty());
        all
    }

    fn moves(&self, axis: Axis) -> bool {
        let run = self.motion.position[axis]
            .get(self.judged.clone())
            .unwrap_or(&[]);
        let (low, high) = run.iter().fold((f64::MAX, f64::MIN), |(low, high), p| {
            (low.min(*p), high.max(*p))
        });
        high - low > MOVES
    }

    /// Encoder of an axis: equation (1) at every tick where it is a number.
    fn encoder(&self, axis: Axis, of: fn(&super::record::Tick) -> PerAxis<f64>) -> Vec<Raw> {
        let ticks = self.record.ticks.iter().enumerate();
        ticks
            .skip(self.record.lead_in)
            .filter_map(|(k, tick)| {
                let nominal = tick.commanded[axis] + self.record.offset(tick.at)[axis];
                let deviation = of(tick)[axis] - nominal;
                deviation.is_finite().then_some(Raw {
                    place: k as f64,
                    deviation,
                })
            })
            .collect()
    }

    fn grid(&self, account: &mut Account) -> Vec<Series> {
        let segment = &self.record.segment;
        let Some(axes) = plate_axes(segment.plane) else {
            return vec![];
        };
        let mut places = vec![];
        let (mut read_mm, mut nominal_mm) = ([vec![], vec![]], [vec![], vec![]]);
        for sample in &self.record.grid {
            let kept = if sample.zero_id != segment.zero_id || sample.plane != segment.plane {
                Err(Reason::OtherZero)
            } else if sample.u_mm.is_finite() && sample.v_mm.is_finite() {
                self.place(sample.at, true)
            } else {
                Err(Reason::NotFinite)
            };
            match kept {
                Ok(place) => {
                    let nominal = self.nominal(place, sample.at);
                    places.push(place);
                    for (k, read) in [sample.u_mm, sample.v_mm].into_iter().enumerate() {
                        read_mm[k].push(read);
                        nominal_mm[k].push(nominal[axes[k]]);
                    }
                }
                Err(reason) => account.note(reason),
            }
        }
        let does = [0, 1].map(|k| standing(&read_mm[k], &nominal_mm[k]));
        let kept = both(&does);
        for reason in kept.iter().filter_map(|kept| left_out(*kept)) {
            account.note(reason);
        }
        let series = |k: usize| {
            let all = places.iter().zip(&kept).enumerate();
            let of_kept = all.filter(|(_, (_, kept))| kept[k]);
            let raw = of_kept.map(|(at, (place, _))| Raw {
                place: *place,
                deviation: read_mm[k][at] - nominal_mm[k][at],
            });
            raw.collect()
        };
        vec![(Channel::GridU, series(0)), (Channel::GridV, series(1))]
    }

    /// A length that is read during a circle is that of a ballbar, from the centre.
    fn ballbar(&self, account: &mut Account) -> Option<Series> {
        let segment = &self.record.segment;
        let axes = plate_axes(segment.plane).filter(|_| segment.kind == TestKind::Circle)?;
        let mut series = vec![];
        for sample in &self.record.length {
            let place = if sample.displacement_mm.is_finite() {
                self.place(sample.at, true)
            } else {
                Err(Reason::NotFinite)
            };
            match place {
                Ok(place) => {
                    let nominal = self.nominal(place, sample.at);
                    let [u, v] = axes.map(|a| nominal[a] - segment.centre_mm[a.index()]);
                    // A table has rows at 0 and 90 deg, and does not tell on which side of the play they were read.
                    if u.abs().min(v.abs()) < ON_REVERSAL_MM {
                        account.note(Reason::OnReversal);
                        continue;
                    }
                    series.push(Raw {
                        place,
                        deviation: sample.displacement_mm - u.hypot(v),
                    });
                }
                Err(reason) => account.note(reason),
            }
        }
        Some((Channel::Radial, series))
    }

    fn length(&self, account: &mut Account) -> Option<Series> {
        if self.record.segment.kind == TestKind::Circle {
            return None;
        }
        let axis = self.record.length.first()?.axis;
        let direction = self.beam(axis);
        let sign = if direction[axis.index()] < 0.0 {
            -1.0
        } else {
            1.0
        };
        let (mut places, mut read_mm, mut along_mm) = (vec![], vec![], vec![]);
        for sample in &self.record.length {
            let kept = if sample.zero_id != self.record.segment.zero_id || sample.axis != axis {
                Err(Reason::OtherZero)
            } else if sample.displacement_mm.is_finite() {
                self.place(sample.at, true)
            } else {
                Err(Reason::NotFinite)
            };
            match kept {
                Ok(place) => {
                    places.push(place);
                    read_mm.push(sample.displacement_mm);
                    along_mm.push(self.nominal(place, sample.at).xyz().dot(&direction));
                }
                Err(reason) => account.note(reason),
            }
        }
        let mut series = vec![];
        let does = standing(&read_mm, &along_mm);
        for (at, (place, does)) in places.into_iter().zip(does).enumerate() {
            if does == Standing::Stuck {
                account.note(Reason::Stuck);
            } else {
                let deviation = sign * (read_mm[at] - along_mm[at]);
                series.push(Raw { place, deviation });
            }
        }
        Some((Channel::Length(axis), series))
    }

    /// Direction in which the length grows: of the beam that the segment names, else along the axis, or
    /// along the way that a diagonal goes.
    fn beam(&self, axis: Axis) -> Vector3<f64> {
        let segment = &self.record.segment;
        let named = segment.features.iter().find_map(|id| self.machine.beam(id));
        if let Some(beam) = named {
            return beam.direction();
        }
        let along = Vector3::ith(axis.index(), 1.0);
        if segment.kind != TestKind::Diagonal {
            return along;
        }
        let run = || self.record.ticks.iter().skip(self.record.lead_in);
        let order = |a: &&super::record::Tick, b: &&super::record::Tick| {
            a.commanded[axis].total_cmp(&b.commanded[axis])
        };
        match (run().min_by(order), run().max_by(order)) {
            (Some(low), Some(high)) => (high.commanded.xyz() - low.commanded.xyz())
                .try_normalize(0.0)
                .unwrap_or(along),
            _ => along,
        }
    }

    /// Place of an instant among the ticks.
    pub(super) fn place(&self, at: Stamp<Host>, fixed: bool) -> Result<f64, Reason> {
        let ticks = &self.record.ticks;
        let next = ticks.partition_point(|tick| tick.at <= at);
        let (Some(k), true) = (next.checked_sub(1), next > self.record.lead_in) else {
            return Err(Reason::InGap);
        };
        let turned = |axis: &Axis| ticks[k].commanded[*axis].abs() > TURNED_RAD;
        if fixed && Axis::ROTARY.iter().any(turned) {
            return Err(Reason::RotaryTurned);
        }
        if ticks[k].at == at {
            return Ok(k as f64);
        }
        let Some(after) = ticks.get(next) else {
            return Err(Reason::InGap);
        };
        let dt_s = (after.at - ticks[k].at).as_secs_f64();
        let bow = |axis: Axis| {
            let a = &self.motion.acceleration[axis];
            (a[next] - a[k]).abs() * dt_s * dt_s * OFF_PARABOLA
        };
        if dt_s > GAP_S {
            return Err(Reason::InGap);
        }
        if self.motion.axes.iter().any(|axis| bow(axis) > BOW) {
            let before = k.checked_sub(1).map(|before| &ticks[before]);
            let step_s = before.map_or(0.0, |before| (ticks[k].at - before.at).as_secs_f64());
            // Of axes that stood only some ticks are kept.
            let stood =
                stands(&ticks[k], after) || before.is_some_and(|before| stands(before, &ticks[k]));
            let usual_s = if stood {
                step_s.max(STANDING_S)
            } else {
                step_s
            };
            return Err(if dt_s < FULL_RATE * usual_s {
                Reason::TooUneven
            } else {
                Reason::InGap
            });
        }
        Ok(k as f64 + (at - ticks[k].at).as_secs_f64() / dt_s)
    }

    /// Command and compensation at a place.
    fn nominal(&self, place: f64, at: Stamp<Host>) -> PerAxis<f64> {
        let offset = self.record.offset(at);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a place is an index and a fraction"
        )]
        let k = place as usize;
        let ticks = &self.record.ticks;
        let next = (k + 1).min(ticks.len() - 1);
        let dt_s = (ticks[next].at - ticks[k].at).as_secs_f64();
        let share = place.fract();
        PerAxis::from_fn(|axis| {
            let (a, b) = (ticks[k].commanded[axis], ticks[next].commanded[axis]);
            let along = &self.motion.acceleration[axis];
            let bent = match (along.get(k), along.get(next)) {
                (Some(first), Some(last)) if share > 0.0 => {
                    0.25 * (first + last) * dt_s * dt_s * share * (1.0 - share)
                }
                _ => 0.0,
            };
            a + (b - a) * share - bent + offset[axis]
        })
    }
}

/// Whether a run is read by its touches alone.
pub(super) fn touches_only(kind: TestKind) -> bool {
    matches!(
        kind,
        TestKind::Latency
            | TestKind::Block
            | TestKind::Touch
            | TestKind::Plane
            | TestKind::Bore
            | TestKind::Sphere
            | TestKind::Rotary
            | TestKind::RotaryVerification
    )
}

/// Whether a run is one to be diagnosed at all.
pub(super) fn is_test(kind: TestKind) -> bool {
    !matches!(kind, TestKind::Production | TestKind::Verification)
}

/// Takes the zero of grid and length out of a run's selected readings; a new one is the mean of this run.
pub(super) fn take_zero(zeros: &mut Vec<Zero>, record: &Record, series: &mut [Series]) {
    let segment = &record.segment;
    for is_grid in [true, false] {
        let counts = |channel: &Channel| match channel {
            Channel::GridU | Channel::GridV => is_grid,
            Channel::Length(_) => !is_grid,
            _ => false,
        };
        let mut of_zero: Vec<&mut Series> = series.iter_mut().filter(|s| counts(&s.0)).collect();
        if of_zero.iter().all(|(_, readings)| readings.is_empty()) {
            continue;
        }
        let known = zeros.iter().find(|zero| {
            zero.is_grid == is_grid
                && zero.setup_id == segment.setup_id
                && zero.zero_id == segment.zero_id
        });
        let shift_mm = known.map_or_else(
            || {
                let mean = |k: usize| of_zero.get(k).map_or(0.0, |(_, readings)| mean(readings));
                [mean(0), mean(1)]
            },
            |zero| zero.shift_mm,
        );
        if known.is_none() {
            if zeros.len() >= MOST_ZEROS {
                zeros.remove(0);
            }
            zeros.push(Zero {
                is_grid,
                setup_id: segment.setup_id,
                zero_id: segment.zero_id,
                shift_mm,
            });
        }
        for ((_, readings), shift_mm) in of_zero.iter_mut().zip(shift_mm) {
            for reading in readings.iter_mut() {
                reading.deviation -= shift_mm;
            }
        }
    }
}

fn mean(readings: &[Raw]) -> f64 {
    let sum: f64 = readings.iter().map(|raw| raw.deviation).sum();
    sum / readings.len().max(1) as f64
}

/// What is said of a reading of two coordinates of which these are kept.
const fn left_out(kept: [bool; 2]) -> Option<Reason> {
    match kept {
        [true, true] => None,
        [false, false] => Some(Reason::Stuck),
        _ => Some(Reason::StuckInPart),
    }
}
