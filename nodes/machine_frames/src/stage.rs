//! Positions in, poses out.

use std::sync::Arc;

use machine::{FrameTree, MachineFile};
use metrology::sample::{FrameTransform, JointSample};
use metrology::stamp::Span;
use metrology::{AxisSet, Host, PerAxis, Stage, Stamp};

use crate::config::MachineFramesConfig;
use crate::diagnostic::Diagnostic;
use crate::error::MachineFramesError;

/// What the stage is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Positions of the axes.
    Joints(JointSample),
    /// Time has passed.
    Tick,
}

/// What the stage says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// The frames that are fixed in their parents, all of them, once.
    Fixed(Vec<FrameTransform>),
    /// The frames that move, at one instant.
    Moving(Vec<FrameTransform>),
    /// A condition began or ended.
    Diagnostic(Diagnostic),
}

/// Names of a frame on the graph.
#[derive(Clone, Debug)]
struct Names {
    parent: Arc<str>,
    child: Arc<str>,
}

/// Tells tf where the frames of a machine are.
#[derive(Clone, Debug)]
pub struct MachineFramesStage {
    tree: FrameTree,
    names: Vec<Names>,
    axes: AxisSet,
    period: Span,
    silence: Span,
    fixed_told: bool,
    /// When positions came last, or the stage began to wait for them.
    heard: Option<Stamp<Host>>,
    silent: bool,
    lacking: AxisSet,
    /// Stamp of the positions that were told last.
    told: Option<Stamp<Host>>,
}

impl MachineFramesStage {
    /// From parameters and machine file; `named` makes a frame's name on the graph of its name in the tree.
    ///
    /// # Errors
    /// When a parameter is out of its range or the chain cannot be read.
    pub fn new(
        config: &MachineFramesConfig,
        machine: &MachineFile,
        named: impl Fn(&str) -> String,
    ) -> Result<Self, MachineFramesError> {
        config.check()?;
        let tree = FrameTree::new(machine).map_err(|error| MachineFramesError::Chain { error })?;
        let names = tree.frames().iter().map(|frame| Names {
            parent: named(frame.parent()).into(),
            child: named(frame.name()).into(),
        });
        Ok(Self {
            names: names.collect(),
            axes: tree.axes(),
            tree,
            period: config.period(),
            silence: config.silence(),
            fixed_told: false,
            heard: None,
            silent: false,
            lacking: AxisSet::default(),
            told: None,
        })
    }

    /// The frames whose axes `picked` takes, at these positions.
    fn poses(
        &self,
        at: Stamp<Host>,
        positions: &PerAxis<f64>,
        picked: impl Fn(AxisSet) -> bool,
    ) -> Vec<FrameTransform> {
        let frames = self.tree.frames().iter().zip(&self.names);
        let picked = frames.filter(|(frame, _)| picked(frame.axes()));
        let pose = |(frame, names): (&machine::frames::Frame, &Names)| FrameTransform {
            at,
            parent: Arc::clone(&names.parent),
            child: Arc::clone(&names.child),
            parent_from_child: frame.parent_from_frame(positions),
        };
        picked.map(pose).collect()
    }

    fn joints(&mut self, at: Stamp<Host>, joints: &JointSample, out: &mut Vec<Output>) {
        self.heard = Some(at);
        if std::mem::take(&mut self.silent) {
            out.push(Output::Diagnostic(Diagnostic::Heard));
        }
        let told = joints.axes;
        let lacking: AxisSet = self.axes.iter().filter(|&a| !told.contains(a)).collect();
        if lacking != self.lacking {
            self.lacking = lacking;
            out.push(Output::Diagnostic(if lacking.is_empty() {
                Diagnostic::Complete
            } else {
                Diagnostic::Lacking { axes: lacking }
            }));
        }
        if !self.is_due(joints.at) {
            return;
        }
        let moved = |axes: AxisSet| !axes.is_empty() && axes.iter().all(|axis| told.contains(axis));
        let poses = self.poses(joints.at, &joints.position, moved);
        if !poses.is_empty() {
            self.told = Some(joints.at);
            out.push(Output::Moving(poses));
        }
    }

    /// Two poses of one instant are one too many; time that went back begins anew.
    fn is_due(&self, at: Stamp<Host>) -> bool {
        self.told
            .is_none_or(|told| at < told || (at > told && at - told >= self.period))
    }

    fn tick(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let since = at - *self.heard.get_or_insert(at);
        if !self.silent && since >= self.silence {
            self.silent = true;
            let for_s = since.as_secs_f64();
            out.push(Output::Diagnostic(Diagnostic::Silent { for_s }));
        }
    }
}

impl Stage for MachineFramesStage {
    type Input = Input;
    type Output = Output;
    type Error = MachineFramesError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), MachineFramesError> {
        if !std::mem::replace(&mut self.fixed_told, true) {
            let zero = PerAxis([0.0; 6]);
            out.push(Output::Fixed(self.poses(at, &zero, |axes| axes.is_empty())));
        }
        match input {
            Input::Joints(joints) => self.joints(at, &joints, out),
            Input::Tick => self.tick(at, out),
        }
        Ok(())
    }
}
