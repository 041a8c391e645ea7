//! The grid encoder's whole computation: positions, readings and segments in, geometry models out.
//!
//! Between begin and end of a segment of its kinds, by their stamps, readings are paired with positions: topics
//! arrive in any order, so the readings before a begin are kept for a while. `hold_ms` after the end the recording is reduced and, with those before it, fitted. So the model grows with every
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
use crate::open::Open;
use crate::recording::{GridPoint, Place, Recording, reduce_moving, reduce_stationwise};

/// Readings that are kept in case their segment's begin is still on its way.
const EARLY: usize = 10_000;
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
    /// The last readings that no segment has asked for yet.
    early: VecDeque<GridSample>,
    /// Ended, and the next one has begun, but its last readings or positions may still be on their way.
    ending: Option<Open>,
    open: Option<Open>,
    recordings: Vec<Recording>,
    /// How great disturbances were in the last fit: where the next begins.
    disturbances: Option<[f64; GROUPS]>,
    sequence: u32,
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
            early: VecDeque::with_capacity(EARLY),
            ending: None,
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
            self.early.clear();
            (self.ending, self.open) = (None, None);
        }
        self.pair_waiting();
        Ok(())
    }

    fn take_reading(&mut self, sample: GridSample) {
        let all = [self.ending.as_mut(), self.open.as_mut()];
        if all.into_iter().flatten().any(|open| open.take(&sample)) {
            self.pair_waiting();
            return;
        }
        keep(&mut self.early, sample);
    }

    fn pair_waiting(&mut self) {
        let all = [self.ending.as_mut(), self.open.as_mut()];
        for open in all.into_iter().flatten() {
            open.pair_waiting(&self.log);
        }
    }

    fn take_segment(&mut self, at: Stamp<Host>, segment: TestSegment, out: &mut Vec<Output>) {
        if !Place::is_recorded(segment.kind) {
            return;
        }
        let refused = |run, refusal| Output::Diagnostic(Diagnostic::Refused { run, refusal });
        if segment.begin {
            self.make_room(at, out);
            if let Some(open) = self.open.take() {
                let next = segment.run;
                out.push(refused(open.begin.run, Refusal::NotEnded { next }));
            }
            if segment.plane == TestPlane::None {
                out.push(refused(segment.run, Refusal::NoPlane));
                return;
            }
            self.open = Some(Open::new(segment, self.config.readings_limit));
            while let Some(sample) = self.early.pop_front() {
                self.take_reading(sample);
            }
        } else if let Some(open) = &mut self.open
            && open.begin.run == segment.run
        {
            let early = &mut self.early;
            open.end(at, segment, |sample| keep(early, sample));
        } else {
            out.push(refused(segment.run, Refusal::NotBegun));
        }
    }

    /// The next recording begins: one that has ended is taken in, or goes on waiting for what is still on its way.
    fn make_room(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        if let Some(ending) = self.ending.take() {
            self.close(at, ending, out);
        }
        if let Some(ended) = self.open.take_if(|open| open.end.is_some()) {
            if ended.is_whole() {
                self.close(at, ended, out);
            } else {
                self.ending = Some(ended);
            }
        }
    }

    /// Takes in what is whole, or has waited long enough.
    fn close_what_is_due(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let hold = self.config.hold();
        let has_waited = |open: &mut Open| {
            open.end.as_mut().is_some_and(|(told_at, _)| {
                *told_at = (*told_at).min(at); // host time went back: the wait begins anew
                at - *told_at >= hold
            })
        };
        let ending = self
            .ending
            .take_if(|open| open.is_whole() || has_waited(open));
        let open = self.open.take_if(has_waited);
        for due in [ending, open].into_iter().flatten() {
            self.close(at, due, out);
        }
    }

    /// Takes in a recording.
    fn close(&mut self, at: Stamp<Host>, mut open: Open, out: &mut Vec<Output>) {
        open.pair_waiting(&self.log);
        let n = open.n_unpaired();
        if n > 0 {
            out.push(Output::Diagnostic(Diagnostic::Unpaired { n }));
        }
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

/// For the next segment, should it have begun before this reading.
fn keep(early: &mut VecDeque<GridSample>, sample: GridSample) {
    if early.len() == EARLY {
        early.pop_front();
    }
    early.push_back(sample);
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
        self.close_what_is_due(at, out);
        Ok(())
    }
}
