//! What happens when a block cycle is closed: judge it, fit it, score the predictions, publish.

use metrology::sample::ThermalModel;
use metrology::stamp::Span;
use metrology::{Axis, Host, PerAxis, Stamp};

use crate::alignment;
use crate::block_heights;
use crate::config::SingleBlockJump;
use crate::cycle::Cycle;
use crate::diagnostic::Diagnostic;
use crate::drift_field::{self, Field};
use crate::prediction::{Predictor, Record, Score, residual_um};
use crate::quarantine::{Jump, Verdict, single_block};
use crate::reference::FaceDrift;
use crate::relaxation;
use crate::stage::{Output, ThermalModelStage};
use crate::temperature::{Observed, Regression};

impl ThermalModelStage {
    /// Uses what the open cycle has.
    pub(crate) fn close_cycle(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        let Some(cycle) = self.cycle.take() else {
            return;
        };
        for block in cycle.missing() {
            out.push(Output::Diagnostic(Diagnostic::BlockMissing {
                block_id: self.reference.name_of(block).to_owned(),
                run: cycle.run,
            }));
        }
        if cycle.cold {
            self.take_reference(now, &cycle, out);
        } else if self.reference.taken_at().is_none() {
            out.push(Output::Diagnostic(Diagnostic::NoReference {
                run: cycle.run,
            }));
        } else {
            self.judge(now, &cycle, out);
        }
    }

    fn take_reference(&mut self, now: Stamp<Host>, cycle: &Cycle, out: &mut Vec<Output>) {
        let readings = cycle.readings();
        if !readings.iter().any(|b| b.0.iter().any(Option::is_some)) {
            out.push(Output::Diagnostic(Diagnostic::NoFace { run: cycle.run }));
            return;
        }
        self.reference.take(&readings);
        out.push(Output::Diagnostic(Diagnostic::ReferenceTaken {
            n_faces: self.reference.faces().count(),
            n_expected: 3 * self.reference.n_blocks(),
        }));
        let remark = block_heights::remark(&self.reference.corners());
        out.extend(remark.map(Output::Diagnostic));
        self.quarantine.clear();
        self.forget();
        self.model = None;
        self.axis_updated_at = PerAxis::default();
        // Against itself the reference has drifted by exactly nothing: the first model.
        let faces = self.reference.drifts(&readings);
        self.accept(now, faces, false, out);
    }

    /// Drops what was learnt from updates before a break.
    fn forget(&mut self) {
        self.history.clear();
        self.record = Record::default();
        self.relaxations = PerAxis::default();
        self.regression = None;
        self.predictor = Predictor::Hold;
    }

    fn judge(&mut self, now: Stamp<Host>, cycle: &Cycle, out: &mut Vec<Output>) {
        let mut faces = self.reference.drifts(&cycle.readings());
        if faces.is_empty() {
            out.push(Output::Diagnostic(Diagnostic::NoFace { run: cycle.run }));
            return;
        }
        let previous = self.history.back().map_or(Vec::new(), |u| u.faces.clone());
        match self.quarantine.judge(&previous, &faces) {
            Verdict::Quarantined { jumps } => self.keep_back(now, &jumps, out),
            Verdict::Confirmed { first, jumps } => self.confirmed(now, first, faces, &jumps, out),
            verdict => {
                if verdict == Verdict::Contradicted {
                    out.push(Output::Diagnostic(Diagnostic::JumpContradicted));
                }
                let base: &[FaceDrift] = if self.config.cycle.align_faces {
                    &previous
                } else {
                    &[]
                };
                alignment::to_latest(&mut faces, base);
                self.accept(now, faces, true, out);
            }
        }
    }

    fn keep_back(&mut self, now: Stamp<Host>, jumps: &[Jump], out: &mut Vec<Output>) {
        for jump in jumps {
            out.push(Output::Diagnostic(Diagnostic::Quarantined {
                block_id: self.reference.name_of(jump.block).to_owned(),
                axis: jump.axis,
                change_mm: jump.change_mm,
                limit_mm: jump.limit_mm,
            }));
        }
        if let Some(updated_at) = self.updated_at() {
            out.push(Output::UpdateRequest(self.rule.confirm(now, updated_at)));
        }
        if let Some(mut model) = self.model.take() {
            model.quarantined = true;
            self.publish(model, out);
        }
    }

    /// Both measurements become models, so that whoever compensates can see the jump confirmed too.
    fn confirmed(
        &mut self,
        now: Stamp<Host>,
        mut first: Vec<FaceDrift>,
        mut second: Vec<FaceDrift>,
        jumps: &[Jump],
        out: &mut Vec<Output>,
    ) {
        let alone = single_block(jumps);
        let rebased = alone.is_some() && self.config.single_block_jump == SingleBlockJump::Rebase;
        out.push(Output::Diagnostic(Diagnostic::JumpConfirmed {
            single_block: alone.map(|block| self.reference.name_of(block).to_owned()),
            rebased,
        }));
        if rebased {
            for jump in jumps {
                self.rebase(jump, &mut first, &mut second);
            }
        } else {
            self.forget();
        }
        alignment::to_latest(&mut first, &[]);
        alignment::to_latest(&mut second, &[]);
        self.accept(now, first, rebased, out);
        self.accept(now, second, rebased, out);
    }

    /// Gives the face that jumped a new reference and takes the jump out of both measurements.
    fn rebase(&mut self, jump: &Jump, first: &mut [FaceDrift], second: &mut [FaceDrift]) {
        let is_moved = |f: &FaceDrift| f.block == jump.block && f.axis == jump.axis;
        let previous = self.history.back();
        let previous = previous.and_then(|u| u.faces.iter().copied().find(is_moved));
        let pushed = first.iter().copied().find(is_moved);
        let (Some(previous), Some(pushed)) = (previous, pushed) else {
            return;
        };
        self.reference.rebase(&previous, &pushed);
        let cold_mm = self
            .reference
            .standard_uncertainty_mm(jump.block, jump.axis)
            .expect("a face with a drift has a cold position");
        let both = first.iter_mut().chain(second);
        for face in both.filter(|f| is_moved(f)) {
            face.drift_mm -= jump.change_mm;
            face.standard_uncertainty_mm = face.hot_uncertainty_mm.hypot(cold_mm);
        }
    }

    /// Takes the faces as the machine's drift at their instant.
    fn accept(
        &mut self,
        now: Stamp<Host>,
        faces: Vec<FaceDrift>,
        scored: bool,
        out: &mut Vec<Output>,
    ) {
        let Some(at) = faces.iter().map(|f| f.at).max() else {
            return;
        };
        let field =
            match drift_field::fit(self.config.method, &self.reference, &faces, &self.limits) {
                Ok(field) => field,
                Err(reason) => {
                    out.push(Output::Diagnostic(Diagnostic::FitRefused { reason }));
                    return;
                }
            };
        let temperatures_degc = self
            .thermometers
            .means_degc(now, self.config.temperature.window_s);
        let score = self
            .score(at, &faces, &temperatures_degc)
            .filter(|_| scored);
        self.record_observation(Observed {
            faces,
            temperatures_degc,
        });
        self.learn(out);
        let used = self.predictor;
        if let Some(score) = score {
            self.record.add(score);
        }
        let identified = self.relaxations.0.iter().any(Option::is_some);
        let proven = self
            .regression
            .as_ref()
            .is_some_and(|r| r.is_proven(self.config.temperature.proof_ratio));
        self.predictor = self.record.choose(identified, proven);
        out.extend(score.map(|score| {
            Output::Diagnostic(Diagnostic::Scored {
                score,
                used,
                next: self.predictor,
            })
        }));
        self.rule.reset();
        self.publish_update(at, field, out);
    }

    fn record_observation(&mut self, observed: Observed) {
        self.history.push_back(observed);
        let most = (self.config.temperature.updates + 1).max(self.config.relaxation.updates);
        while self.history.len() > most {
            self.history.pop_front();
        }
    }

    /// Residuals of what each predictor would have said.
    fn score(
        &self,
        at: Stamp<Host>,
        faces: &[FaceDrift],
        temperatures_degc: &[Option<f64>],
    ) -> Option<Score> {
        let held = &self.history.back()?.faces;
        Some(Score {
            hold_um: residual_um(faces, held)?,
            relaxation_um: self.relaxed_faces(at).and_then(|p| residual_um(faces, &p)),
            temperature_um: self
                .regression
                .as_ref()
                .and_then(|r| r.predict(temperatures_degc))
                .and_then(|p| residual_um(faces, &p)),
        })
    }

    /// The last faces, moved on by the identified time constants; `None` without one.
    fn relaxed_faces(&self, at: Stamp<Host>) -> Option<Vec<FaceDrift>> {
        let mut faces = self.rates()?;
        let last = &self.history.back()?.faces;
        for (face, last) in faces.iter_mut().zip(last) {
            let elapsed_s = (at - last.at).as_secs_f64();
            let acted_s = self.relaxations[last.axis].as_ref().map_or(0.0, |r| {
                metrology::drift::relaxed_s(elapsed_s, r.time_constant_s)
            });
            face.drift_mm = last.drift_mm + face.drift_mm * acted_s;
        }
        Some(faces)
    }

    /// The last faces with their rates (mm/s) for drifts; zero where none is identified.
    fn rates(&self) -> Option<Vec<FaceDrift>> {
        if self.relaxations.0.iter().all(Option::is_none) {
            return None;
        }
        let mut faces = self.history.back()?.faces.clone();
        for axis in Axis::LINEAR {
            let rates = self.relaxations[axis]
                .as_ref()
                .map(|r| r.rates_mm_s.as_slice());
            for (nth, face) in faces.iter_mut().filter(|f| f.axis == axis).enumerate() {
                face.drift_mm = rates.and_then(|r| r.get(nth)).copied().unwrap_or(0.0);
            }
        }
        Some(faces)
    }

    /// Looks for time constants and fits the temperatures anew.
    fn learn(&mut self, out: &mut Vec<Output>) {
        if self.config.relaxation.enabled {
            let since = self.load_changed_at;
            let usable: Vec<&[FaceDrift]> = self
                .history
                .iter()
                .map(|u| u.faces.as_slice())
                .filter(|f| f.iter().all(|f| since.is_none_or(|since| f.at >= since)))
                .collect();
            let recent = &usable[usable.len().saturating_sub(self.config.relaxation.updates)..];
            for axis in Axis::LINEAR {
                let found = relaxation::identify(axis, recent, &self.config.relaxation);
                out.push(Output::Diagnostic(match &found {
                    Ok(r) => Diagnostic::TimeConstant {
                        axis,
                        time_constant_s: r.time_constant_s,
                        lower_s: r.interval_s.0,
                        upper_s: r.interval_s.1,
                    },
                    Err(reason) => Diagnostic::NoTimeConstant {
                        axis,
                        reason: *reason,
                    },
                }));
                self.relaxations[axis] = found.ok();
            }
        }
        if self.config.temperature.enabled {
            self.regression = Regression::fit(self.history.make_contiguous());
            out.extend(self.regression.as_ref().map(|r| {
                Output::Diagnostic(Diagnostic::TemperatureRegression {
                    left_out_rms_um: r.left_out_rms_mm * 1e3,
                    hold_rms_um: r.hold_rms_mm * 1e3,
                    n_increments: r.n_increments,
                    proven: r.is_proven(self.config.temperature.proof_ratio),
                })
            }));
        }
    }

    fn publish_update(&mut self, at: Stamp<Host>, mut field: Field, out: &mut Vec<Output>) {
        out.extend(field.remarks.drain(..).map(Output::Diagnostic));
        if self.predictor == Predictor::Relaxation
            && let Some(rates) = self.rates()
        {
            self.let_grow(&mut field, &rates, out);
        }
        let axes = self.merge_with_previous(at, field.axes, out);
        let measured = self.history.back().map_or(&[][..], |u| &u.faces);
        let n_blocks = (0..self.reference.n_blocks())
            .filter(|block| measured.iter().any(|f| f.block == *block))
            .count();
        let model = ThermalModel {
            at,
            axes,
            valid_from: at,
            valid_until: at + self.validity(),
            n_blocks: u32::try_from(n_blocks).unwrap_or(u32::MAX),
            lack_of_fit_p: field.lack_of_fit_p,
            quarantined: false,
            sequence: 0,
        };
        self.publish(model, out);
    }

    /// Extrapolates the field by the faces of every axis that shows a time constant; those of the
    /// others are held.
    fn let_grow(&self, field: &mut Field, rates: &[FaceDrift], out: &mut Vec<Output>) {
        for source in Axis::LINEAR {
            let Some(relaxation) = &self.relaxations[source] else {
                continue;
            };
            let mut own = rates.to_vec();
            for face in own.iter_mut().filter(|f| f.axis != source) {
                face.drift_mm = 0.0;
            }
            match drift_field::fit(self.config.method, &self.reference, &own, &self.limits) {
                Ok(rates) => {
                    let tau_s = relaxation.time_constant_s;
                    drift_field::add_growth(&mut field.axes, source, &rates.axes, tau_s);
                }
                Err(reason) => out.push(Output::Diagnostic(Diagnostic::FitRefused { reason })),
            }
        }
    }

    fn validity(&self) -> Span {
        Span::from_secs_f64(self.config.validity_min * 60.0)
    }

    /// An axis with a face missing keeps its previous drift as long as that is valid: a model with
    /// fewer terms would jump.
    fn merge_with_previous(
        &mut self,
        at: Stamp<Host>,
        mut axes: PerAxis<Option<metrology::sample::AxisDrift>>,
        out: &mut Vec<Output>,
    ) -> PerAxis<Option<metrology::sample::AxisDrift>> {
        for axis in Axis::LINEAR {
            if self.is_whole(axis) {
                self.axis_updated_at[axis] = Some(at);
                continue;
            }
            let previous = self
                .model
                .as_ref()
                .and_then(|m| Some((m.at, m.axes[axis]?)));
            match (previous, self.axis_updated_at[axis]) {
                (Some((from, drift)), Some(updated_at)) if at - updated_at <= self.validity() => {
                    let elapsed_s = (at - from).as_secs_f64();
                    axes[axis] = Some(drift_field::advanced(axis, &drift, elapsed_s));
                    out.push(Output::Diagnostic(Diagnostic::AxisKept { axis }));
                }
                (Some(_), Some(_)) => {
                    axes[axis] = None;
                    out.push(Output::Diagnostic(Diagnostic::AxisDropped { axis }));
                }
                _ => {}
            }
        }
        axes
    }

    /// Whether the last update has every face of `axis` that the reference has.
    fn is_whole(&self, axis: Axis) -> bool {
        let measured = self.history.back().map_or(&[][..], |u| &u.faces);
        self.reference
            .faces()
            .filter(|(_, a)| *a == axis)
            .all(|(block, _)| measured.iter().any(|f| f.block == block && f.axis == axis))
    }

    /// Greatest drift at a face that is expected since the last update, mm: by the predictor in use,
    /// or at the pace of the last interval where that is to hold.
    pub(crate) fn expected_drift_mm(&self, now: Stamp<Host>) -> f64 {
        let Some(last) = self.history.back() else {
            return 0.0;
        };
        let predicted = match self.predictor {
            Predictor::Relaxation => self.relaxed_faces(now),
            Predictor::Temperature => self.by_temperature(now),
            Predictor::Hold => self
                .history
                .iter()
                .nth_back(1)
                .map(|before| paced(&before.faces, &last.faces, now)),
        };
        predicted.map_or(0.0, |faces| greatest_change_mm(&last.faces, &faces))
    }

    fn by_temperature(&self, now: Stamp<Host>) -> Option<Vec<FaceDrift>> {
        let degc = self
            .thermometers
            .means_degc(now, self.config.temperature.window_s);
        self.regression.as_ref()?.predict(&degc)
    }

    /// A model for `now` by temperatures, where they still speak.
    pub(crate) fn publish_by_temperature(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        let (Some(predicted), Some(last)) = (self.by_temperature(now), self.history.back()) else {
            return;
        };
        let mut faces = last.faces.clone();
        for face in &mut faces {
            if let Some(moved) = predicted.iter().find(|p| p.same_face(face)) {
                face.drift_mm = moved.drift_mm;
            }
        }
        let field =
            match drift_field::fit(self.config.method, &self.reference, &faces, &self.limits) {
                Ok(field) => field,
                Err(reason) => {
                    out.push(Output::Diagnostic(Diagnostic::FitRefused { reason }));
                    return;
                }
            };
        let Some(mut model) = self.model.clone() else {
            return;
        };
        // What is predicted is less certain than what was touched, by what left-out updates missed.
        let left_out_mm = self.regression.as_ref().map_or(0.0, |r| r.left_out_rms_mm);
        for axis in Axis::LINEAR {
            let (Some(held), Some(mut predicted)) = (model.axes[axis], field.axes[axis]) else {
                continue;
            };
            if self.is_whole(axis) {
                predicted.measured_at = held.measured_at;
                predicted.covariance[(0, 0)] += left_out_mm * left_out_mm;
                model.axes[axis] = Some(predicted);
            }
        }
        model.at = now;
        self.publish(model, out);
    }
}

/// Faces moved on at the pace between two updates.
fn paced(before: &[FaceDrift], last: &[FaceDrift], now: Stamp<Host>) -> Vec<FaceDrift> {
    let mut faces = last.to_vec();
    for face in &mut faces {
        let Some(earlier) = before.iter().find(|b| b.same_face(face)) else {
            continue;
        };
        let base_s = (face.at - earlier.at).as_secs_f64();
        if base_s > 0.0 {
            let pace_mm_s = (face.drift_mm - earlier.drift_mm) / base_s;
            face.drift_mm += pace_mm_s * (now - face.at).as_secs_f64();
        }
    }
    faces
}

fn greatest_change_mm(from: &[FaceDrift], to: &[FaceDrift]) -> f64 {
    from.iter()
        .filter_map(|f| Some((to.iter().find(|t| t.same_face(f))?.drift_mm - f.drift_mm).abs()))
        .fold(0.0, f64::max)
}
