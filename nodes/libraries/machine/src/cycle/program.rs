//! Writes the moves of a cycle and refuses those that leave the travel.
//!
//! G0 is written for three moves only: at the top of Z, straight up from beside or above a surface, and back
//! from a contact to the start of its touch. Every other move goes at the guarded feed, equation (5) of
//! [`super`], so that the ball never meets a surface in G0, wherever the surface really lies.

use std::fmt::Write as _;

use metrology::sample::TestKind;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use super::reach::{check_feed, guarded_feed_mm_min, linear};
use super::{Cycle, PlannedTouch};
use crate::error::CycleError;
use crate::file::MachineFile;
use crate::poses::SphereDesign;
use crate::program_frame::HEAD;

/// Distance kept from the top of Z, so that a compensation can still be added to the command, mm.
pub(crate) const TRAVEL_MARGIN_MM: f64 = 1.0;

/// An approach that rises by no more than this leads to a surface that does not reach over its start.
const LEVEL: f64 = 1e-9;

/// One wanted touch.
pub(super) struct Touch {
    pub(super) feature_id: String,
    pub(super) approach: Vector3<f64>,
    pub(super) contact_mm: Vector3<f64>,
    pub(super) feed_mm_min: f64,
    /// Added to the stand-off of the machine file, mm.
    pub(super) extra_standoff_mm: f64,
}

impl Touch {
    /// A touch at the probe's ordinary feed.
    pub(super) fn ordinary(
        file: &MachineFile,
        feature_id: String,
        approach: Vector3<f64>,
        contact_mm: Vector3<f64>,
    ) -> Self {
        Self {
            feature_id,
            approach,
            contact_mm,
            feed_mm_min: file.probe.feed_mm_min,
            extra_standoff_mm: 0.0,
        }
    }
}

/// How the ball gets to the start of a touch.
#[derive(Clone, Copy)]
pub(super) enum Path {
    /// Up to the top of Z, across, down.
    Over,
    /// Up to this height (ball centre, mm), across, down: around one block.
    LowOver(f64),
    /// Straight, from where the last touch began.
    Straight,
}

/// A program that grows move by move; the ball's place is always known to it.
pub(super) struct Program<'a> {
    file: &'a MachineFile,
    text: String,
    touches: Vec<PlannedTouch>,
    features: Vec<String>,
    top_z_mm: f64,
    ball_radius_mm: f64,
    guarded_feed_mm_min: f64,
    /// Where Z stands, mm.
    at_z_mm: f64,
    /// Whether the last surface reaches over the ball's place, so that a way up leads past it.
    is_overhung: bool,
    /// Ball less linear positions, mm: what a turned head adds.
    ball_from_slides_mm: Vector3<f64>,
}

impl<'a> Program<'a> {
    /// Starts at the top of Z with the rotary axes at zero.
    pub(super) fn new(file: &'a MachineFile) -> Result<Self, CycleError> {
        for axis in Axis::LINEAR {
            linear(file, axis)?;
        }
        let top_z_mm = linear(file, Axis::Z)?.travel_mm[1] - TRAVEL_MARGIN_MM;
        let mut program = Self {
            file,
            text: String::from(HEAD),
            touches: Vec::new(),
            features: Vec::new(),
            top_z_mm,
            ball_radius_mm: file.ball_radius_mm(),
            guarded_feed_mm_min: guarded_feed_mm_min(file)?,
            at_z_mm: top_z_mm,
            is_overhung: false,
            ball_from_slides_mm: Vector3::zeros(),
        };
        program.line(format_args!("G0 Z{}", Number(top_z_mm)));
        program.rotary_to_zero()?;
        Ok(program)
    }

    /// Effective radius of the stylus ball, mm.
    pub(super) const fn ball_radius_mm(&self) -> f64 {
        self.ball_radius_mm
    }

    /// Position of Z at its top, mm.
    pub(super) const fn top_z_mm(&self) -> f64 {
        self.top_z_mm
    }

    /// Turns the rotary axes with the tool at the top of Z.
    pub(super) fn turn_to(&mut self, design: &SphereDesign, pose_rad: &PerAxis<f64>) {
        self.rise_to(self.top_z_mm);
        let mut words = String::new();
        for &axis in design.rotary_axes() {
            let _ = write!(words, " {axis}{}", Number(pose_rad[axis].to_degrees()));
        }
        self.line(format_args!("G0{words}"));
        self.ball_from_slides_mm = design.ball_from_slides_mm(pose_rad);
    }

    fn rotary_to_zero(&mut self) -> Result<(), CycleError> {
        let mut words = String::new();
        for axis in Axis::ROTARY {
            let Some(entry) = self.file.rotary_axis(axis) else {
                continue;
            };
            let [least, greatest] = entry.travel_deg;
            if !(least..=greatest).contains(&0.0) {
                return Err(CycleError::OutsideTravel {
                    feature: String::from("start of the cycle"),
                    axis,
                    position: 0.0,
                    least,
                    greatest,
                });
            }
            let _ = write!(words, " {axis}0");
        }
        if !words.is_empty() {
            self.line(format_args!("G0{words}"));
        }
        Ok(())
    }

    /// Moves to the start of a touch, touches, and backs off to the start.
    pub(super) fn touch(&mut self, touch: Touch, path: Path) -> Result<(), CycleError> {
        check_feed(
            self.file,
            &touch.feature_id,
            &touch.approach,
            touch.feed_mm_min,
        )?;
        let standoff_mm = self.file.probe.standoff_mm + touch.extra_standoff_mm;
        let ball = touch.contact_mm - touch.approach * self.ball_radius_mm; // (1)
        let start = ball - touch.approach * standoff_mm; // (2)
        let target = ball + touch.approach * self.file.probe.overtravel_mm;
        self.go(&touch.feature_id, &start, path)?;
        self.check_travel(&touch.feature_id, &target)?;
        self.line(format_args!("(feature: {})", touch.feature_id));
        self.line(format_args!(
            "G38.2 {} F{}",
            Words(&self.slides(&target)),
            Number(touch.feed_mm_min)
        ));
        self.line(format_args!("G0 {}", Words(&self.slides(&start))));
        self.is_overhung = touch.approach.z > LEVEL;
        self.touches.push(PlannedTouch {
            feature_id: touch.feature_id,
            approach: touch.approach,
            contact_mm: touch.contact_mm,
            feed_mm_min: touch.feed_mm_min,
            standoff_mm,
        });
        Ok(())
    }

    /// Moves the ball's centre to `point`.
    pub(super) fn go(
        &mut self,
        feature: &str,
        point: &Vector3<f64>,
        path: Path,
    ) -> Result<(), CycleError> {
        self.check_travel(feature, point)?;
        let slides = self.slides(point);
        let height_mm = match path {
            Path::Straight => {
                self.guarded(format_args!("{}", Words(&slides)));
                self.at_z_mm = slides.z;
                return Ok(());
            }
            Path::Over => self.top_z_mm,
            Path::LowOver(height_mm) => (height_mm - self.ball_from_slides_mm.z).min(self.top_z_mm),
        };
        self.rise_to(height_mm);
        let across = format!("X{} Y{}", Number(slides.x), Number(slides.y));
        if height_mm < self.top_z_mm {
            self.guarded(format_args!("{across}"));
        } else {
            self.line(format_args!("G0 {across}"));
        }
        self.guarded(format_args!("Z{}", Number(slides.z)));
        self.at_z_mm = slides.z;
        self.is_overhung = false;
        Ok(())
    }

    /// Z to a height: G0 where nothing can be met on the way.
    fn rise_to(&mut self, height_mm: f64) {
        if self.is_overhung || height_mm < self.at_z_mm {
            self.guarded(format_args!("Z{}", Number(height_mm)));
        } else {
            self.line(format_args!("G0 Z{}", Number(height_mm)));
        }
        self.at_z_mm = height_mm;
        self.is_overhung = false;
    }

    /// A move that may meet a surface.
    fn guarded(&mut self, words: std::fmt::Arguments<'_>) {
        let feed_mm_min = self.guarded_feed_mm_min;
        self.line(format_args!("G1 {words} F{}", Number(feed_mm_min)));
    }

    /// Names a block, face or artefact that the cycle touches.
    pub(super) fn name_feature(&mut self, name: &str) {
        if !self.features.iter().any(|known| known == name) {
            self.features.push(name.to_owned());
        }
    }

    /// Retracts and ends the program.
    pub(super) fn finish(mut self, kind: TestKind) -> Cycle {
        self.rise_to(self.top_z_mm);
        self.line(format_args!("M2"));
        Cycle {
            program: self.text,
            touches: self.touches,
            kind,
            features: self.features,
        }
    }

    /// Linear positions that put the ball's centre at a point.
    fn slides(&self, ball_mm: &Vector3<f64>) -> Vector3<f64> {
        ball_mm - self.ball_from_slides_mm
    }

    fn check_travel(&self, feature: &str, ball_mm: &Vector3<f64>) -> Result<(), CycleError> {
        let point = self.slides(ball_mm);
        for axis in Axis::LINEAR {
            let [least, greatest] = linear(self.file, axis)?.travel_mm;
            let position = point[axis.index()];
            if !(least..=greatest).contains(&position) {
                return Err(CycleError::OutsideTravel {
                    feature: feature.to_owned(),
                    axis,
                    position,
                    least,
                    greatest,
                });
            }
        }
        Ok(())
    }

    fn line(&mut self, words: std::fmt::Arguments<'_>) {
        let _ = writeln!(self.text, "{words}"); // writing to a String cannot fail
    }
}

/// A coordinate or feed, to 10 nm, without a negative zero.
pub(crate) struct Number(pub(crate) f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let rounded = (self.0 * 1e5).round() / 1e5 + 0.0;
        let rounded = if rounded.abs() < 5e-6 { 0.0 } else { rounded };
        write!(f, "{rounded}")
    }
}

/// X, Y and Z words of a point.
pub(crate) struct Words<'a>(pub(crate) &'a Vector3<f64>);

impl std::fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(p) = self;
        write!(f, "X{} Y{} Z{}", Number(p.x), Number(p.y), Number(p.z))
    }
}
