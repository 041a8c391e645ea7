//! Speeds along a chain of motions, so that each can still stop at the chain's end.
//!
//! # Model
//!
//! ```text
//!   v_out[i] = min(corner[i], v_lim[i], v_lim[i+1], √(v_out[i+1]² + 2 a[i+1] s[i+1]))   backwards  (1)
//!   v_out[i] = min(v_out[i], √(v_in[i]² + 2 a[i] s[i]))                                 forwards   (2)
//! ```
//!
//! Inside a piece the speed is a trapezoid from v_in over a plateau to v_out. A chain starts and ends
//! at rest; touches, dwells and spindle changes end it (exact stop).
//!
//! # Holds when
//! Every piece has finite positive limits. Jerk is not limited: accelerations step, as on a control
//! without jerk limit; the position loop smooths them.

use metrology::PerAxis;

use crate::path::{AxisLimits, Segment};

/// Speed over time inside one piece: up, level, down.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Trapezoid {
    speed_in: f64,
    speed_top: f64,
    speed_out: f64,
    acceleration: f64,
    up_s: f64,
    level_s: f64,
    down_s: f64,
}

impl Trapezoid {
    fn new(segment: &Segment, speed_in: f64, speed_out: f64) -> Self {
        let a = segment.acceleration_limit;
        let reachable =
            (a * segment.length + 0.5 * (speed_in * speed_in + speed_out * speed_out)).sqrt();
        let speed_top = segment
            .speed_limit
            .min(reachable)
            .max(speed_in)
            .max(speed_out);
        let ramps =
            (2.0 * speed_top * speed_top - speed_in * speed_in - speed_out * speed_out) / (2.0 * a);
        Self {
            speed_in,
            speed_top,
            speed_out,
            acceleration: a,
            up_s: (speed_top - speed_in) / a,
            level_s: (segment.length - ramps).max(0.0) / speed_top,
            down_s: (speed_top - speed_out) / a,
        }
    }

    fn duration_s(&self) -> f64 {
        self.up_s + self.level_s + self.down_s
    }

    /// Distance and speed after `time_s`.
    fn at(&self, time_s: f64) -> (f64, f64) {
        let a = self.acceleration;
        if time_s < self.up_s {
            let speed = self.speed_in + a * time_s;
            return (0.5 * (self.speed_in + speed) * time_s, speed);
        }
        let up = 0.5 * (self.speed_in + self.speed_top) * self.up_s;
        let level_s = time_s - self.up_s;
        if level_s < self.level_s {
            return (up + self.speed_top * level_s, self.speed_top);
        }
        let down_s = (level_s - self.level_s).min(self.down_s);
        let speed = self.speed_top - a * down_s;
        let level = self.speed_top * self.level_s;
        (up + level + 0.5 * (self.speed_top + speed) * down_s, speed)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Planned {
    segment: Segment,
    tag: usize,
    speed_out: f64,
    profile: Trapezoid,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Progress {
    /// As planned; time within the piece, s.
    Following(f64),
    /// Slowing down ahead of plan: distance within the piece and speed.
    Stopping {
        s: f64,
        speed: f64,
    },
    Done,
}

/// Motions between two stops, executed in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    planned: Vec<Planned>,
    index: usize,
    progress: Progress,
    /// Where in its piece it came to rest ahead of plan.
    rested_at: Option<f64>,
}

/// Command at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Positions, mm or rad.
    pub position: PerAxis<f64>,
    /// Velocities, mm/s or rad/s.
    pub velocity: PerAxis<f64>,
}

impl Chain {
    /// An empty chain with room for `capacity` pieces.
    #[must_use]
    pub fn with_capacity(capacity: usize) -> Self {
        Self {
            planned: Vec::with_capacity(capacity),
            index: 0,
            progress: Progress::Done,
            rested_at: None,
        }
    }

    /// Makes room for `capacity` pieces, so that `push` does not allocate.
    pub fn reserve(&mut self, capacity: usize) {
        self.clear();
        self.planned.reserve(capacity);
    }

    /// Forgets every piece.
    pub fn clear(&mut self) {
        self.planned.clear();
        self.index = 0;
        self.progress = Progress::Done;
        self.rested_at = None;
    }

    /// What is left of the piece in which it came to rest ahead of plan, with its tag; `None` at the end of a piece.
    #[must_use]
    pub fn rest(&self, limits: &AxisLimits) -> Option<(Segment, usize)> {
        let planned = self.planned.get(self.index)?;
        let rest = planned.segment.rest(self.rested_at?, limits)?;
        Some((rest, planned.tag))
    }

    /// Appends a piece; `tag` is given back while it is executed.
    pub fn push(&mut self, segment: Segment, tag: usize) {
        self.planned.push(Planned {
            segment,
            tag,
            speed_out: 0.0,
            profile: Trapezoid::new(&segment, 0.0, 0.0),
        });
    }

    /// Plans every speed and stands ready at the first piece.
    pub fn plan(&mut self, limits: &AxisLimits) {
        let mut reach = f64::INFINITY;
        for index in (0..self.planned.len()).rev() {
            let this = self.planned[index].segment;
            let out = match self.planned.get(index + 1) {
                None => 0.0,
                Some(next) => this
                    .corner_speed(&next.segment, limits)
                    .min(this.speed_limit)
                    .min(next.segment.speed_limit)
                    .min(reach),
            };
            self.planned[index].speed_out = out;
            reach = (out * out + 2.0 * this.acceleration_limit * this.length).sqrt();
        }
        let mut speed_in = 0.0_f64;
        for planned in &mut self.planned {
            let segment = &planned.segment;
            let reach =
                (speed_in * speed_in + 2.0 * segment.acceleration_limit * segment.length).sqrt();
            let speed_out = planned.speed_out.min(reach);
            planned.profile = Trapezoid::new(segment, speed_in, speed_out);
            speed_in = speed_out;
        }
        self.index = 0;
        self.progress = if self.planned.is_empty() {
            Progress::Done
        } else {
            Progress::Following(0.0)
        };
    }

    /// Whether it has come to rest.
    #[must_use]
    pub fn done(&self) -> bool {
        self.progress == Progress::Done
    }

    /// Whether it has come to rest where its last piece ends, or has no piece.
    #[must_use]
    pub fn at_end(&self) -> bool {
        let is_last = self.index + 1 >= self.planned.len();
        self.done() && is_last && self.rested_at.is_none()
    }

    /// Tag of the piece that is being executed.
    #[must_use]
    pub fn tag(&self) -> Option<usize> {
        self.planned.get(self.index).map(|planned| planned.tag)
    }

    /// From now on slows down along the path as quickly as the path allows.
    pub fn stop(&mut self) {
        if let (Progress::Following(time_s), Some(planned)) =
            (self.progress, self.planned.get(self.index))
        {
            let (s, speed) = planned.profile.at(time_s);
            self.progress = Progress::Stopping { s, speed };
        }
    }

    /// Goes on by `period_s` and gives the command there; `None` where nothing moves.
    pub fn advance(&mut self, period_s: f64) -> Option<Command> {
        match self.progress {
            Progress::Done => None,
            Progress::Following(time_s) => Some(self.follow(time_s + period_s)),
            Progress::Stopping { s, speed } => Some(self.slow_down(s, speed, period_s)),
        }
    }

    fn follow(&mut self, mut time_s: f64) -> Command {
        loop {
            let planned = &self.planned[self.index];
            let duration_s = planned.profile.duration_s();
            if time_s < duration_s {
                let (s, speed) = planned.profile.at(time_s);
                self.progress = Progress::Following(time_s);
                return command(&planned.segment, s, speed);
            }
            if self.index + 1 == self.planned.len() {
                self.progress = Progress::Done;
                return at_rest(*planned.segment.end());
            }
            time_s -= duration_s;
            self.index += 1;
        }
    }

    fn slow_down(&mut self, mut s: f64, mut speed: f64, period_s: f64) -> Command {
        let mut left_s = period_s;
        loop {
            let segment = &self.planned[self.index].segment;
            let a = segment.acceleration_limit;
            let time_s = left_s.min(speed / a);
            let end = s + speed * time_s - 0.5 * a * time_s * time_s;
            if end < segment.length {
                if time_s < left_s {
                    self.progress = Progress::Done;
                    self.rested_at = Some(end);
                    return at_rest(segment.position(end));
                }
                speed -= a * time_s;
                self.progress = Progress::Stopping { s: end, speed };
                return command(segment, end, speed);
            }
            let speed_at_end = (speed * speed - 2.0 * a * (segment.length - s))
                .max(0.0)
                .sqrt();
            if self.index + 1 == self.planned.len() || speed_at_end <= 0.0 {
                self.progress = Progress::Done;
                return at_rest(*segment.end());
            }
            left_s -= (speed - speed_at_end) / a;
            (s, speed) = (0.0, speed_at_end);
            self.index += 1;
        }
    }
}

fn at_rest(position: PerAxis<f64>) -> Command {
    Command {
        position,
        velocity: PerAxis::default(),
    }
}

fn command(segment: &Segment, s: f64, speed: f64) -> Command {
    let mut velocity = segment.tangent(s);
    velocity.0.iter_mut().for_each(|rate| *rate *= speed);
    Command {
        position: segment.position(s),
        velocity,
    }
}
