//! The grid encoder's whole computation: positions, readings and segments in, geometry models out.
//!
//! Between begin and end of a segment of its kinds, readings are paired with positions; `hold_ms` after the
//! end the recording is reduced and, with those before it, fitted. So the model grows with every
//! recording, and more of its coefficients become estimable. A recording made anew in the same place replaces
//! the older one only by its number in the list: repeats tell what noise is, and the oldest leave at
//! `recordings_limit`.

use std::collections::VecDeque;

use machine::{Kinematics, MachineFile};
use metrology::sample::{AxisState, GeometryModel, GridSample, TestPlane, TestSegment};
use metrology::{AxisSet, ErrorComponent, Host, PerAxis, Stage, Stamp};

use crate::axis_log::AxisLog;
use crate::config::GridEncoderConfig;
use crate::diagnostic::{Diagnostic, Refusal};
use crate::error::GridEncoderError;
use crate::geometry::geometry_model;
use crate::identify::{Disturbed, GROUPS, Identification, identify};
use crate::recording::{Collector, GridPoint, Place, Recording, reduce_moving, reduce_stationwise};

/// Readings that may wait for positions.
const WAITING: usize = 10_000;
/// Ratio of singular values below which the rank is a matter of opinion.
const CLEAR_GAP: f64 = 30.0;

/// What the node is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Positions at one servo tick.
    State(AxisState),
    /// A reading of the grid.
    Reading(GridSample),
    /// Begin or end of a test.
    Segment(TestSegment),
    /// Time passes.
    Tick,
}

/// What the node says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A model, ready to be used.
    Model(GeometryModel),
    /// Everything behind it.
    Identification(Box<Identification>),
    /// A recording as it entered the fit.
    Recording(Box<Recording>),
    /// A condition worth reporting.
    Diagnostic(Diagnostic),
}

/// The grid encoder's computation.
#[derive(Clone, Debug)]
pub struct GridEncoderStage {
    config: GridEncoderConfig,
    axes: AxisSet,
    kinematics: Kinematics,
    components: Vec<ErrorComponent>,
    resolution_mm: f64,
    plate_radius_mm: f64,
    log: AxisLog,
    waiting: VecDeque<GridSample>,
    open: Option<Open>,
    recordings: Vec<Recording>,
    /// How great disturbances were in the last fit: where the next begins.
    disturbances: Option<[f64; GROUPS]>,
    sequence: u32,
}

/// A recording under way.
#[derive(Clone, Debug)]
struct Open {
    begin: TestSegment,
    collector: Collector,
    /// Readings whose positions the log no longer held.
    n_unpaired: usize,
    /// When the end was told, and what it said.
    end: Option<(Stamp<Host>, TestSegment)>,
}

impl GridEncoderStage {
    /// From parameters and machine file.
    ///
    /// # Errors
    /// Parameters out of range, unknown components, a chain that cannot be read, no grid encoder.
    pub fn new(config: &GridEncoderConfig, file: &MachineFile) -> Result<Self, GridEncoderError> {
        config.check()?;
        let kinematics =
            Kinematics::new(file).map_err(|error| GridEncoderError::Chain { error })?;
        let plate = file
            .grid_encoder
            .as_ref()
            .ok_or(GridEncoderError::NoGridEncoder)?;
        Ok(Self {
            axes: file.axis_set(),
            components: config.components_for(kinematics.chain())?,
            kinematics,
            resolution_mm: plate.resolution_um / 1e3,
            plate_radius_mm: plate.radius_mm,
            log: AxisLog::new(config.log_samples, config.positions),
            waiting: VecDeque::new(),
            open: None,
            recordings: Vec::new(),
            disturbances: None,
            sequence: 0,
            config: config.clone(),
        })
    }

    /// The recordings that are fitted together, oldest first.
    #[must_use]
    pub fn recordings(&self) -> &[Recording] {
        &self.recordings
    }

    fn take_state(
        &mut self,
        state: &AxisState,
        out: &mut Vec<Output>,
    ) -> Result<(), GridEncoderError> {
        if let Some(axis) = self.axes.iter().find(|axis| !state.axes.contains(*axis)) {
            return Err(GridEncoderError::AxisMissing { axis });
        }
        let newest = self.log.newest();
        if !self.log.push(state) {
            let by_s = newest.map_or(0.0, |newest| (newest - state.received_at).as_secs_f64());
            out.push(Output::Diagnostic(Diagnostic::ClockWentBack { by_s }));
            self.waiting.clear();
            self.open = None;
        }
        self.pair_waiting();
        Ok(())
    }

    fn take_reading(&mut self, sample: GridSample) {
        let Some(open) = &mut self.open else { return };
        let within = sample.at >= open.begin.at
            && open.end.as_ref().is_none_or(|(_, end)| sample.at <= end.at);
        if !within || !open.collector.accepts(&sample) {
            return;
        }
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
            open.n_unpaired += 1;
        }
        self.waiting.push_back(sample);
        self.pair_waiting();
    }

    /// Pairs every reading that the log has reached.
    fn pair_waiting(&mut self) {
        let Some(open) = &mut self.open else {
            self.waiting.clear();
            return;
        };
        let Some(newest) = self.log.newest() else {
            return;
        };
        while let Some(sample) = self.waiting.front()
            && sample.at <= newest
        {
            match self.log.pair(sample) {
                Some(pair) => open.collector.push(pair),
                None => open.n_unpaired += 1,
            }
            self.waiting.pop_front();
        }
    }

    fn take_segment(&mut self, at: Stamp<Host>, segment: TestSegment, out: &mut Vec<Output>) {
        if !Place::is_recorded(segment.kind) {
            return;
        }
        let refused = |run, refusal| Output::Diagnostic(Diagnostic::Refused { run, refusal });
        if segment.begin {
            self.close(at, true, out);
            if let Some(open) = self.open.take() {
                let next = segment.run;
                out.push(refused(open.begin.run, Refusal::NotEnded { next }));
            }
            self.waiting.clear();
            if segment.plane == TestPlane::None {
                out.push(refused(segment.run, Refusal::NoPlane));
                return;
            }
            self.open = Some(Open {
                collector: Collector::new(
                    segment.plane,
                    segment.zero_id,
                    self.config.readings_limit,
                ),
                begin: segment,
                n_unpaired: 0,
                end: None,
            });
        } else if let Some(open) = &mut self.open
            && open.begin.run == segment.run
        {
            open.end = Some((at, segment));
        } else {
            out.push(refused(segment.run, Refusal::NotBegun));
        }
    }

    /// Takes in a recording whose positions have all come, or which waited long enough.
    fn close(&mut self, at: Stamp<Host>, at_once: bool, out: &mut Vec<Output>) {
        let Some((told_at, end)) = self.open.as_mut().and_then(|open| open.end.as_mut()) else {
            return;
        };
        *told_at = (*told_at).min(at); // host time went back: the wait begins anew
        let waited = at - *told_at >= self.config.hold();
        let reached = self.log.newest().is_some_and(|newest| newest > end.at) && waited;
        if !(reached || waited || at_once) {
            return;
        }
        self.pair_waiting();
        let Some(open) = self.open.take() else { return };
        if open.n_unpaired + self.waiting.len() > 0 {
            let n = open.n_unpaired + self.waiting.len();
            out.push(Output::Diagnostic(Diagnostic::Unpaired { n }));
        }
        self.waiting.clear();
        let run = open.begin.run;
        let refusals = self.take_in(&open, out);
        let n = open.collector.n_told_before();
        if n > 0 {
            out.push(Output::Diagnostic(Diagnostic::ToldBefore { run, n }));
        }
        if refusals.is_empty() {
            self.fit(at, out);
        }
        out.extend(
            refusals
                .into_iter()
                .map(|refusal| Output::Diagnostic(Diagnostic::Refused { run, refusal })),
        );
    }

    /// Reduces a recording and adds it to the list, or says why not.
    fn take_in(&mut self, open: &Open, out: &mut Vec<Output>) -> Vec<Refusal> {
        let run = open.begin.run;
        let completed = open.end.as_ref().is_some_and(|(_, end)| end.completed);
        let mut refusals = open
            .collector
            .refusals(self.config.gap_limit(), self.plate_radius_mm);
        if !completed {
            refusals.push(Refusal::NotCompleted);
        }
        if !refusals.is_empty() {
            return refusals;
        }
        let place = Place::from(&open.begin);
        let (points, outliers) = self.reduce(open, &place);
        if let Some(refusal) = self.too_few(&place, points.len()) {
            return vec![refusal];
        }
        let mut say = |diagnostic| out.push(Output::Diagnostic(diagnostic));
        let n = open.collector.n_not_finite();
        if n > 0 {
            say(Diagnostic::LeftOut { run, n });
        }
        if points.len() < place.stations as usize {
            let (found, planned) = (points.len(), place.stations);
            say(Diagnostic::StationsMissing {
                run,
                found,
                planned,
            });
        }
        let squares: f64 = points
            .iter()
            .map(|point| {
                point
                    .standard_uncertainty_mm
                    .iter()
                    .map(|u| u * u)
                    .sum::<f64>()
                    / 2.0
            })
            .sum();
        say(Diagnostic::Recorded {
            run,
            points: points.len(),
            readings: open.collector.pairs().len(),
            outliers,
            standard_uncertainty_um: (squares / points.len() as f64).sqrt() * 1e3,
        });
        if self.recordings.len() == self.config.recordings_limit {
            let oldest = self.recordings.remove(0);
            let limit = self.config.recordings_limit;
            say(Diagnostic::Dropped {
                run: oldest.run,
                limit,
            });
        }
        let recording = Recording { run, place, points };
        out.push(Output::Recording(Box::new(recording.clone())));
        self.recordings.push(recording);
        Vec::new()
    }

    fn reduce(&self, open: &Open, place: &Place) -> (Vec<GridPoint>, usize) {
        let pairs = open.collector.pairs();
        let rules = self.config.station_rules(self.resolution_mm);
        if place.stations > 0 {
            reduce_stationwise(pairs, place, &rules)
        } else {
            reduce_moving(pairs, place, self.config.bins, &rules)
        }
    }

    fn too_few(&self, place: &Place, found: usize) -> Option<Refusal> {
        let least = self.config.least_readings;
        let planned = place.stations;
        // Half of a circle tells other things than a circle.
        if planned > 0 && (found < least.min(planned as usize) || found * 2 < planned as usize) {
            let least = least.max(planned as usize / 2);
            return Some(Refusal::TooFewStations {
                found,
                planned,
                least,
            });
        }
        (planned == 0 && found < least).then_some(Refusal::TooFewPoints { found, least })
    }

    fn fit(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let spans = self.spans();
        let mut options = self.config.options(&self.components, &spans);
        if let Disturbed::Found { start } = &mut options.disturbed {
            *start = self.disturbances;
        }
        let found = match identify(&self.kinematics, &self.recordings, &options) {
            Ok(found) => found,
            Err(reason) => {
                // The recording that contradicts the others must not stand in the way of the next.
                self.recordings.pop();
                out.push(Output::Diagnostic(Diagnostic::NotFitted { reason }));
                return;
            }
        };
        self.disturbances = found.disturbances.map(|told| told.ratios);
        self.sequence += 1;
        let chain = self.kinematics.chain().to_string();
        out.push(Output::Model(geometry_model(
            &found,
            &chain,
            at,
            self.sequence,
        )));
        self.report(&found, out);
        out.push(Output::Identification(Box::new(found)));
    }

    fn report(&self, found: &Identification, out: &mut Vec<Output>) {
        let coefficients = found.n_coefficients;
        let mut say = |diagnostic| out.push(Output::Diagnostic(diagnostic));
        say(Diagnostic::Fitted {
            recordings: self.recordings.len(),
            rank: found.rank,
            unknowns: found.unknowns.len(),
            estimable: (0..coefficients)
                .filter(|idx| found.estimate(*idx).is_some())
                .count(),
            coefficients,
            residual_um: found.residual_standard_deviation_mm * 1e3,
        });
        if found.gap.kept < CLEAR_GAP * found.gap.dropped {
            let (kept, dropped) = (found.gap.kept, found.gap.dropped);
            say(Diagnostic::NoGap { kept, dropped });
        }
        if found
            .judgement
            .lacks_something(self.config.lack_of_fit_limit)
        {
            say(Diagnostic::LackOfFit {
                lack_of_fit_p: found.judgement.lack_of_fit_p,
                correlation: found.judgement.correlation,
            });
        }
        if let Some(told) = found.disturbances {
            let um = |mm: f64| mm * 1e3;
            say(Diagnostic::Disturbed {
                plate_um: um(told.plate_mm),
                shift_um: um(told.shift_mm),
                ramp_um: um(told.ramp_mm),
                strain_um: um(told.strain_mm),
            });
        }
        if found.n_outliers > 0 {
            let (n, of) = (found.n_outliers, found.n_equations);
            say(Diagnostic::Outliers { n, of });
        }
    }

    fn spans(&self) -> PerAxis<(f64, f64)> {
        crate::equations::spans(&self.recordings)
    }
}

impl Stage for GridEncoderStage {
    type Input = Input;
    type Output = Output;
    type Error = GridEncoderError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), GridEncoderError> {
        match input {
            Input::State(state) => self.take_state(&state, out)?,
            Input::Reading(sample) => self.take_reading(sample),
            Input::Segment(segment) => self.take_segment(at, segment, out),
            Input::Tick => {}
        }
        self.close(at, false, out);
        Ok(())
    }
}
