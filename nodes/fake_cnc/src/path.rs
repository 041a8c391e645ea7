//! One motion as a curve of all axes over its own length, with the speed it may have.
//!
//! # Model
//!
//! ```text
//!   straight:  x_i(s) = x_i0 + m_i s                                              (1)
//!   speed:     v ≤ F,  v ≤ V_i / |m_i|,  v ≤ s_end / T                            (2)
//!   tangential acceleration:  a ≤ b A_i / |m_i|                                   (3)
//!   arc: v² (r φ'² + 2 |r' φ'|) ≤ 0.8 b A,  a ρ ≤ 0.6 b A,  A = min(A_1, A_2)       (4)
//!   corner: v |m_i⁺ - m_i⁻| ≤ (1 - b) A_i T                                        (5)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | distance along X Y Z, or along the rotary axes where X Y Z rest | mm, or rad |
//! | V_i, A_i | limits of axis i | mm/s, mm/s² (rad) |
//! | b | 1 - [`CORNER_SHARE`] | 1 |
//! | T | servo period | s |
//! | ρ | speed in the plane of the arc over path speed | 1 |
//!
//! Because of (2) a piece lasts at least T, so at most one corner's worth of velocity jump falls into
//! the window of a second difference of commands; with (3) to (5) that difference never exceeds
//! A_i T² (`prop_commands_never_exceed_the_limits_of_an_axis`).
//!
//! An arc across a plane that is turned about Z is a curve of the turned axes: (1) to (4) hold along them, with the
//! smaller limits of X and Y over √2 each, so that either of the machine's axes keeps its own.
//!
//! Feed: F is along X Y Z when any of them moves and rotary axes follow in the same time; with
//! rotary axes alone it is along them, in deg/min (RS274/NGC 2.1.2.5).

use metrology::{Axis, AxisSet, PerAxis};

use crate::rs274::program::{Aim, Feed, Motion};
use crate::sweep::Sweep;

/// Share of an axis' acceleration that is kept for corners.
pub const CORNER_SHARE: f64 = 0.25;
/// Pieces shorter than this are points, mm or rad.
const SHORTEST: f64 = 1e-9;
/// Shares of an arc's acceleration: across and along the path; their squares add up to 1.
const ACROSS: f64 = 0.8;
const ALONG: f64 = 0.6;

/// What the axes can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// The machine's axes.
    pub axes: AxisSet,
    /// Greatest speed, mm/s or rad/s.
    pub speed: PerAxis<f64>,
    /// Greatest acceleration, mm/s² or rad/s².
    pub acceleration: PerAxis<f64>,
    /// Servo period, s.
    pub period_s: f64,
}

/// The circular part of a curve: two axes and their sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Circle {
    axes: [Axis; 2],
    sweep: Sweep,
}

/// One piece of path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    start: PerAxis<f64>,
    end: PerAxis<f64>,
    slope: PerAxis<f64>,
    circle: Option<Circle>,
    /// Cosine and sine of the angle by which slope and circle are turned about Z.
    turn: Option<[f64; 2]>,
    along_linear: bool,
    /// Length that is done already, mm (rad).
    done: f64,
    /// Length, mm (rad for rotary axes alone).
    pub length: f64,
    /// Greatest speed by feed, axes and curvature, mm/s (rad/s).
    pub speed_limit: f64,
    /// Greatest acceleration along the path, mm/s² (rad/s²).
    pub acceleration_limit: f64,
}

/// Where `motion` leads from `from`.
#[must_use]
pub fn target(motion: &Motion, from: &PerAxis<f64>) -> PerAxis<f64> {
    let mut target = PerAxis::from_fn(|axis| match motion.aim[axis] {
        Aim::Keep => from[axis],
        Aim::At(value) => value,
        Aim::By(step) => from[axis] + step,
    });
    if let Some(slide) = motion.slide {
        let [x, y] = slide.end_mm([from[Axis::X], from[Axis::Y]]);
        (target[Axis::X], target[Axis::Y]) = (x, y);
    }
    target
}

/// X and Y turned about Z by the angle of which these are cosine and sine.
fn turned(mut of: PerAxis<f64>, [cos, sin]: [f64; 2]) -> PerAxis<f64> {
    let (x, y) = (of[Axis::X], of[Axis::Y]);
    of[Axis::X] = x * cos - y * sin;
    of[Axis::Y] = x * sin + y * cos;
    of
}

/// Limits along axes that are turned about Z.
fn turned_limits(limits: &AxisLimits) -> AxisLimits {
    let mut turned = *limits;
    for of in [&mut turned.speed, &mut turned.acceleration] {
        let each = of[Axis::X].min(of[Axis::Y]) * std::f64::consts::FRAC_1_SQRT_2;
        (of[Axis::X], of[Axis::Y]) = (each, each);
    }
    turned
}

impl Segment {
    /// The piece from `from` along `motion`; `None` where it has no length.
    #[must_use]
    pub fn new(motion: &Motion, from: &PerAxis<f64>, limits: &AxisLimits) -> Option<Self> {
        let end = target(motion, from);
        let mut delta = PerAxis::from_fn(|axis| end[axis] - from[axis]);
        let turn = motion.arc.and_then(|arc| arc.turn);
        if let Some([cos, sin]) = turn {
            delta = turned(delta, [cos, -sin]);
        }
        let circle = motion.arc.map(|arc| {
            let [first, second, _] = arc.plane.axes();
            Circle {
                axes: [first, second],
                sweep: Sweep::new(&arc, [first, second].map(|axis| delta[axis])),
            }
        });
        let mut arc_mm = 0.0;
        if let Some(Circle { axes, sweep }) = circle {
            arc_mm = (sweep.radius_mm + 0.5 * sweep.widening_mm) * sweep.swept_rad.abs();
            axes.into_iter().for_each(|axis| delta[axis] = 0.0);
        }
        let linear = delta.xyz().norm().hypot(arc_mm);
        let rotary = Axis::ROTARY
            .into_iter()
            .fold(0.0_f64, |sum, axis| sum.hypot(delta[axis]));
        let along_linear = linear > SHORTEST;
        let length = if along_linear { linear } else { rotary };
        if length <= SHORTEST {
            return None;
        }
        let mut segment = Self {
            start: *from,
            end,
            slope: PerAxis::from_fn(|axis| delta[axis] / length),
            circle,
            turn,
            along_linear,
            done: 0.0,
            length,
            speed_limit: length / limits.period_s,
            acceleration_limit: f64::INFINITY,
        };
        if turn.is_some() {
            segment.limit(motion.feed, &turned_limits(limits));
        } else {
            segment.limit(motion.feed, limits);
        }
        Some(segment)
    }

    /// What is left of it after `s`; `None` where that is nothing.
    #[must_use]
    pub fn rest(&self, s: f64, limits: &AxisLimits) -> Option<Self> {
        let length = self.length - s;
        if length <= SHORTEST {
            return None;
        }
        Some(Self {
            start: self.position(s),
            done: self.done + s,
            length,
            speed_limit: self.speed_limit.min(length / limits.period_s),
            ..*self
        })
    }

    fn limit(&mut self, feed: Feed, limits: &AxisLimits) {
        let mut speed = self.speed_limit;
        let mut acceleration = f64::INFINITY;
        if let Feed::Rate {
            linear_mm_s,
            rotary_rad_s,
        } = feed
        {
            speed = speed.min(if self.along_linear {
                linear_mm_s
            } else {
                rotary_rad_s
            });
        }
        let share = 1.0 - CORNER_SHARE;
        for axis in limits.axes.iter() {
            let slope = self.slope[axis].abs();
            if slope > 0.0 {
                speed = speed.min(limits.speed[axis] / slope);
                acceleration = acceleration.min(share * limits.acceleration[axis] / slope);
            }
        }
        if let Some(Circle { axes, sweep }) = &self.circle {
            let least = |of: &PerAxis<f64>| of[axes[0]].min(of[axes[1]]);
            let available = share * least(&limits.acceleration);
            let turning = sweep.swept_rad.abs() / self.length;
            let widening = sweep.widening_mm.abs() / self.length;
            let radius = sweep.greatest_radius_mm();
            let in_plane = (radius * turning).hypot(widening);
            let curvature = radius * turning * turning + 2.0 * widening * turning;
            speed = speed
                .min(least(&limits.speed) / in_plane)
                .min((ACROSS * available / curvature).sqrt());
            acceleration = acceleration.min(ALONG * available / in_plane);
        }
        self.speed_limit = speed;
        self.acceleration_limit = acceleration;
    }

    /// Where it starts.
    #[must_use]
    pub const fn start(&self) -> &PerAxis<f64> {
        &self.start
    }

    /// Where it ends, exactly as programmed.
    #[must_use]
    pub const fn end(&self) -> &PerAxis<f64> {
        &self.end
    }

    /// Positions at distance `s`.
    #[must_use]
    pub fn position(&self, s: f64) -> PerAxis<f64> {
        if s >= self.length {
            return self.end;
        }
        let Some(turn) = self.turn else {
            return self.unturned_position(s);
        };
        let way = turned(self.way(s), turn);
        PerAxis::from_fn(|axis| self.start[axis] + way[axis])
    }

    fn unturned_position(&self, s: f64) -> PerAxis<f64> {
        let mut position = self.start;
        for (value, slope) in position.0.iter_mut().zip(&self.slope.0) {
            *value += slope * s;
        }
        if let Some(Circle { axes, .. }) = &self.circle {
            let point = self.point(s);
            for (axis, value) in axes.iter().zip(point) {
                position[*axis] = self.start[*axis] + value;
            }
        }
        position
    }

    /// Way from the start along the turned axes, at distance `s`.
    fn way(&self, s: f64) -> PerAxis<f64> {
        let mut way = PerAxis::from_fn(|axis| self.slope[axis] * s);
        if let Some(Circle { axes, .. }) = &self.circle {
            for (axis, value) in axes.iter().zip(self.point(s)) {
                way[*axis] = value;
            }
        }
        way
    }

    /// Point of the circle at distance `s`, from the start.
    fn point(&self, s: f64) -> [f64; 2] {
        let Some(Circle { sweep, .. }) = &self.circle else {
            return [0.0; 2];
        };
        let point = sweep.point(self.share(s));
        if self.done <= 0.0 {
            return point;
        }
        let begun = sweep.point(self.share(0.0));
        [point[0] - begun[0], point[1] - begun[1]]
    }

    /// Share of the whole way at distance `s`.
    fn share(&self, s: f64) -> f64 {
        (self.done + s) / (self.done + self.length)
    }

    /// Change of the positions with distance, at distance `s`.
    #[must_use]
    pub fn tangent(&self, s: f64) -> PerAxis<f64> {
        let mut tangent = self.slope;
        if let Some(Circle { axes, sweep }) = &self.circle {
            let (share, whole) = (self.share(s), self.done + self.length);
            let (sin, cos) = (sweep.from_rad + share * sweep.swept_rad).sin_cos();
            let turning = sweep.swept_rad / whole;
            let widening = sweep.widening_mm / whole;
            let radius = sweep.radius_mm + share * sweep.widening_mm;
            tangent[axes[0]] = widening * cos - radius * turning * sin;
            tangent[axes[1]] = widening * sin + radius * turning * cos;
        }
        self.turn.map_or(tangent, |turn| turned(tangent, turn))
    }

    /// Greatest speed at which the corner from this piece to `next` may be passed, by (5).
    #[must_use]
    pub fn corner_speed(&self, next: &Self, limits: &AxisLimits) -> f64 {
        if self.along_linear != next.along_linear {
            return 0.0;
        }
        let before = self.tangent(self.length);
        let after = next.tangent(0.0);
        let mut speed = f64::INFINITY;
        for axis in limits.axes.iter() {
            let jump = (after[axis] - before[axis]).abs();
            if jump > 1e-12 {
                let allowed = CORNER_SHARE * limits.acceleration[axis] * limits.period_s;
                speed = speed.min(allowed / jump);
            }
        }
        speed
    }
}
