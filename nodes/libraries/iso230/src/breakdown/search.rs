//! Adds spikes, cyclic errors and tones to the linear rows for as long as chance does not explain them.
//!
//! # Model
//!
//! A candidate is judged by what it would take off the sum of squares, Δ, and by the chance that noise alone
//! makes as much: `projector`, (3) and (4).
//!
//! The candidate of greatest Δ that is believed joins; then all are searched again. At the end each
//! found one must stand the test beside all others, its variance inflated if residuals drag on.
//! Decay times and frequencies maximise Δ; their uncertainty is that of its curvature. That of
//! amplitudes holds for the decay, pitch or frequency found.
//!
//! Where samples stand close together the search takes their means (`thin`). The fit that is reported has all
//! samples, and vibration is looked for in its residuals.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::columns::Columns;
use super::error::BreakdownError;
use super::maximum::{by_curvature, greatest};
use super::periodogram::{self, Tone};
use super::plane::Input;
use super::projector::{LONGEST_DECAY_RAD, Projector};
use super::report::NotFound;
use super::robust::{Fit, fit};
use super::scene::Scene;
use super::spike::SLOWEST_RISE;
use super::term::{Quadrature, RowKey, Term};
use super::thin::{thinned, would_do};
use super::{cause, cyclic};

/// Effects without which none is searched again beside the others.
const LEAST_TO_POLISH: usize = 2;
/// Decay times that are tried, evenly in the logarithm.
const DECAYS: usize = 25;
/// Shapes of pulses that are tried.
const PULSES: f64 = (DECAYS * (SLOWEST_RISE as usize + 1)) as f64;
/// Most times that the play is fitted anew with its own width.
const PLAY_STEPS: usize = 6;
/// Play whose width changes less is settled, mm.
const PLAY_SETTLED_MM: f64 = 1e-6;
/// Deviations of a backlash above 0 for it to have a width.
const PLAY_IS_SEEN: f64 = 4.0;

/// What kind of effect a candidate is; each kind is looked for once on each axis, tones several times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Spike(usize),
    Cyclic(usize),
    Tone,
}

/// An effect that may join the fit.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub kind: Kind,
    pub terms: Vec<Term>,
    /// Δ, mm².
    pub gain_mm2: f64,
    /// Chance that noise makes it.
    pub chance: f64,
    /// Standard uncertainty of decay or frequency; 0 where there is none.
    pub nonlinear_uncertainty: f64,
    /// Amplitude that would have been believed, mm.
    pub detectable_mm: f64,
}

/// The fit with all that was found, and what was not.
#[derive(Debug)]
pub(super) struct Found {
    pub fit: Fit,
    pub chosen: Vec<Candidate>,
    pub not_found: Vec<NotFound>,
}

/// Everything that can be found in a plane.
pub(super) fn search(input: &Input, scene: &Scene) -> Result<Found, BreakdownError> {
    let mut base = Term::linear(scene);
    for axis in [0, 1] {
        if let Some(pitch_mm) = input.config.given_pitch_mm(scene.axes[axis]) {
            base.extend(cyclic_terms(axis, pitch_mm));
        }
    }
    let columns = Columns::new(scene);
    let fewer = if would_do(scene, input.config) {
        thinned(
            scene,
            &fit(&columns, base.clone(), input.config)?,
            input.config,
        )
    } else {
        None
    };
    let Effects {
        mut chosen,
        mut last,
        fit: found,
    } = match &fewer {
        Some(fewer) => effects(input, &Columns::new(fewer), &base)?,
        None => effects(input, &columns, &base)?,
    };
    if fewer.is_some() {
        // In the means a fast vibration may stand at a frequency that it does not have.
        chosen.retain(|c| c.kind != Kind::Tone);
        last.retain(|c| c.kind != Kind::Tone);
    }
    // A fit of all samples with the chosen columns is not made twice.
    let mut fit = match found.filter(|_| fewer.is_none()) {
        Some(fit) => fit,
        None => fit_with_play(input, &columns, &base, &chosen)?,
    };
    if fewer.is_some() {
        fit = add_tones(input, &columns, &base, &mut chosen, &mut last, fit)?;
    }
    while let Some(weakest) = weakest(input, scene, &fit, &chosen) {
        last.push(chosen.remove(weakest));
        fit = fit_with_play(input, &columns, &base, &chosen)?;
    }
    let not_found = not_found(input, scene, &chosen, &last);
    Ok(Found {
        fit,
        chosen,
        not_found,
    })
}

/// The effects that are believed.
struct Effects {
    chosen: Vec<Candidate>,
    /// Those that were tried last.
    last: Vec<Candidate>,
    /// With the chosen ones; none where they were polished after it.
    fit: Option<Fit>,
}

/// The effects that are believed, each beside the others.
fn effects(input: &Input, columns: &Columns, base: &[Term]) -> Result<Effects, BreakdownError> {
    let mut chosen: Vec<Candidate> = Vec::new();
    let (mut last, mut fit) = add_believed(input, columns, base, &mut chosen)?;
    // Tones that were found before the rest was known are found anew.
    let n_chosen = chosen.len();
    chosen.retain(|c| c.kind != Kind::Tone);
    if chosen.len() < n_chosen {
        (last, fit) = add_believed(input, columns, base, &mut chosen)?;
    }
    let is_polished = chosen.len() >= LEAST_TO_POLISH;
    Ok(Effects {
        chosen: polished(input, columns, base, chosen)?,
        last,
        fit: (!is_polished).then_some(fit),
    })
}

/// Adds believed tones beside what is chosen, until there is none.
fn add_tones(
    input: &Input,
    columns: &Columns,
    base: &[Term],
    chosen: &mut Vec<Candidate>,
    last: &mut Vec<Candidate>,
    mut fit: Fit,
) -> Result<Fit, BreakdownError> {
    while n_tones(chosen) < input.config.most_tones {
        let projector = Projector::new(columns, &fit, input.config.least_sine);
        let Some(tone) = periodogram::strongest(&projector, input.config) else {
            break;
        };
        let candidate = tone_candidate(&tone);
        if candidate.chance >= input.config.false_alarm {
            last.push(candidate);
            break;
        }
        chosen.push(candidate);
        fit = fit_with_play(input, columns, base, chosen)?;
    }
    Ok(fit)
}

fn n_tones(chosen: &[Candidate]) -> usize {
    chosen.iter().filter(|c| c.kind == Kind::Tone).count()
}

/// Adds the greatest believed candidate until no candidate is believed; gives the last ones that were tried, and the fit beside
/// which they were.
fn add_believed(
    input: &Input,
    columns: &Columns,
    base: &[Term],
    chosen: &mut Vec<Candidate>,
) -> Result<(Vec<Candidate>, Fit), BreakdownError> {
    loop {
        let fit = fit_with_play(input, columns, base, chosen)?;
        let tried = candidates(
            input,
            &Projector::new(columns, &fit, input.config.least_sine),
            chosen,
        );
        let believed = tried.iter().filter(|c| c.chance < input.config.false_alarm);
        match believed.max_by(|a, b| a.gain_mm2.total_cmp(&b.gain_mm2)) {
            Some(best) => chosen.push(best.clone()),
            None => return Ok((tried, fit)),
        }
    }
}

/// Fits base and chosen terms, the play of each backlash taken up as far as it is wide.
fn fit_with_play(
    input: &Input,
    columns: &Columns,
    base: &[Term],
    chosen: &[Candidate],
) -> Result<Fit, BreakdownError> {
    let mut terms = base.to_vec();
    terms.extend(
        chosen
            .iter()
            .flat_map(|candidate| candidate.terms.iter().copied()),
    );
    let mut best = fit(columns, terms, input.config)?;
    for _ in 0..PLAY_STEPS {
        let mut terms = best.terms.clone();
        let mut change = 0.0_f64;
        for (at, column) in best.reduction.kept.iter().enumerate() {
            if let Some(Term::Backlash { width_mm, .. }) = terms.get_mut(*column) {
                let (b, u) = (best.parameters[at], best.covariance[(at, at)].sqrt());
                let new_mm = if b > PLAY_IS_SEEN * u { b } else { 0.0 };
                change = change.max((new_mm - *width_mm).abs());
                *width_mm = new_mm;
            }
        }
        if change < PLAY_SETTLED_MM {
            break;
        }
        let next = fit(columns, terms, input.config)?;
        if next.variance_mm2 >= best.variance_mm2 {
            break;
        }
        best = next;
    }
    Ok(best)
}

fn cyclic_terms(axis: usize, pitch_mm: f64) -> Vec<Term> {
    let parts = [Quadrature::Sine, Quadrature::Cosine];
    parts
        .map(|part| Term::Cyclic {
            axis,
            pitch_mm,
            part,
        })
        .to_vec()
}

/// The best candidate of each kind that is not chosen yet.
fn candidates(input: &Input, projector: &Projector, chosen: &[Candidate]) -> Vec<Candidate> {
    let is_new = |kind: Kind| chosen.iter().all(|c| c.kind != kind);
    let mut found = Vec::new();
    for axis in [0, 1] {
        if is_new(Kind::Spike(axis)) {
            found.extend(spike(input, projector, axis));
        }
        if is_new(Kind::Cyclic(axis))
            && input
                .config
                .given_pitch_mm(projector.scene().axes[axis])
                .is_none()
        {
            found.extend(cyclic(input, projector, axis));
        }
    }
    if n_tones(chosen) < input.config.most_tones {
        found.extend(
            periodogram::strongest(projector, input.config).map(|tone| tone_candidate(&tone)),
        );
    }
    found
}

fn tone_candidate(tone: &Tone) -> Candidate {
    Candidate {
        kind: Kind::Tone,
        terms: tone.terms.clone(),
        gain_mm2: tone.gain_mm2,
        chance: tone.chance,
        nonlinear_uncertainty: tone.uncertainty_hz,
        detectable_mm: tone.detectable_mm,
    }
}

fn spike_terms(scene: &Scene, axis: usize, rise: u8, decay_s: f64) -> Vec<Term> {
    let conditions = 0..scene.conditions.len();
    conditions
        .map(|condition| Term::Spike {
            axis,
            condition,
            rise,
            decay_s,
        })
        .collect()
}

/// Logarithms of the shortest and longest decay that the samples can show, s.
fn decay_range(scene: &Scene) -> (f64, f64) {
    let shortest = |t: &super::scene::Trace| t.spacing_rad / t.speed_rad_s();
    let longest = |t: &super::scene::Trace| LONGEST_DECAY_RAD / t.speed_rad_s();
    let low = scene
        .traces
        .iter()
        .map(shortest)
        .fold(f64::INFINITY, f64::min);
    let high = scene.traces.iter().map(longest).fold(0.0, f64::max);
    (low.ln(), high.max(2.0 * low).ln())
}

fn spike(input: &Input, projector: &Projector, axis: usize) -> Option<Candidate> {
    let (low, high) = decay_range(projector.scene());
    let step = (high - low) / (DECAYS - 1) as f64;
    let terms = |rise: u8, log: f64| spike_terms(projector.scene(), axis, rise, log.exp());
    let tried =
        (0..=SLOWEST_RISE).flat_map(|rise| (0..DECAYS).map(move |i| (rise, low + step * i as f64)));
    let gains = tried.map(|(rise, log)| {
        let gain = projector.gain_of_known(&terms(rise, log));
        (gain.map_or(0.0, |g| g.0), rise, log)
    });
    let (_, rise, coarse) = gains.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let gain = |log: f64| projector.gain_of(&terms(rise, log)).map_or(0.0, |g| g.0);
    let log = greatest((coarse - step).max(low), (coarse + step).min(high), gain);
    let terms = terms(rise, log);
    let (gain_mm2, square) = projector.gain_of(&terms)?;
    let variance = projector.fit.variance_mm2;
    Some(Candidate {
        kind: Kind::Spike(axis),
        gain_mm2,
        chance: projector.chance(gain_mm2, terms.len(), PULSES),
        nonlinear_uncertainty: log.exp() * by_curvature(log, 0.1 * step, variance, gain),
        detectable_mm: projector.detectable_mm(
            square,
            terms.len(),
            PULSES,
            input.config.false_alarm,
        ),
        terms,
    })
}

fn cyclic(input: &Input, projector: &Projector, axis: usize) -> Option<Candidate> {
    let scene = projector.scene();
    let candidates_mm = input.config.candidates_mm(scene.axes[axis]);
    let resolved = candidates_mm
        .iter()
        .copied()
        .filter(|p| cyclic::is_resolved(*p, scene));
    let gains =
        resolved.filter_map(|p| Some((p, projector.gain_of_known(&cyclic_terms(axis, p))?)));
    let (pitch_mm, (gain_mm2, square)) = gains.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let trials = candidates_mm.len() as f64;
    Some(Candidate {
        kind: Kind::Cyclic(axis),
        terms: cyclic_terms(axis, pitch_mm),
        gain_mm2,
        chance: projector.chance(gain_mm2, 2, trials),
        nonlinear_uncertainty: 0.0,
        detectable_mm: projector.detectable_mm(square, 2, trials, input.config.false_alarm),
    })
}

/// Searches each decay and pitch again beside all others.
fn polished(
    input: &Input,
    columns: &Columns,
    base: &[Term],
    mut chosen: Vec<Candidate>,
) -> Result<Vec<Candidate>, BreakdownError> {
    if chosen.len() < LEAST_TO_POLISH {
        return Ok(chosen);
    }
    for at in 0..chosen.len() {
        let mut others = chosen.clone();
        let own = others.remove(at);
        let fit = fit_with_play(input, columns, base, &others)?;
        let projector = Projector::new(columns, &fit, input.config.least_sine);
        let again = match own.kind {
            Kind::Spike(axis) => spike(input, &projector, axis),
            Kind::Cyclic(axis) => cyclic(input, &projector, axis),
            Kind::Tone => None,
        };
        if let Some(again) = again {
            chosen[at] = again;
        }
    }
    Ok(chosen)
}

/// The chosen effect that chance explains best beside all others, if it does.
fn weakest(input: &Input, scene: &Scene, fit: &Fit, chosen: &[Candidate]) -> Option<usize> {
    let chance = |candidate: &Candidate| {
        let is_own = |column: &usize| candidate.terms.contains(&fit.terms[*column]);
        let places = fit
            .reduction
            .kept
            .iter()
            .enumerate()
            .filter(|(_, c)| is_own(c));
        let trials = match candidate.kind {
            Kind::Spike(_) => PULSES,
            Kind::Cyclic(axis) => input.config.candidates_mm(scene.axes[axis]).len() as f64,
            // The false alarms over all frequencies are judged by the spectrum's own floor.
            Kind::Tone => 1.0,
        };
        (trials * wald(fit, &places.map(|(at, _)| at).collect::<Vec<_>>()).1).min(1.0)
    };
    let chances = chosen.iter().map(chance).enumerate();
    let weakest = chances.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (weakest.1 >= input.config.false_alarm).then_some(weakest.0)
}

/// Rise of the sum of squares without some kept columns (mm²), and the chance of at least that.
pub(super) fn wald(fit: &Fit, columns: &[usize]) -> (f64, f64) {
    let own = fit.covariance.select_columns(columns).select_rows(columns);
    let values = fit.parameters.select_rows(columns);
    let m = columns.len() as f64;
    let Some(factor) = own.cholesky() else {
        return (0.0, 1.0);
    };
    let square = values.dot(&factor.solve(&values));
    let freedom = fit.degrees_of_freedom as f64;
    let chance = FisherSnedecor::new(m, freedom).map_or(1.0, |f| f.sf(square / m));
    (square * fit.variance_mm2 * fit.inflation, chance)
}

fn not_found(
    input: &Input,
    scene: &Scene,
    chosen: &[Candidate],
    last: &[Candidate],
) -> Vec<NotFound> {
    let mut kinds = vec![
        Kind::Spike(0),
        Kind::Spike(1),
        Kind::Cyclic(0),
        Kind::Cyclic(1),
        Kind::Tone,
    ];
    kinds.retain(|kind| chosen.iter().all(|c| c.kind != *kind));
    kinds.retain(|kind| match kind {
        Kind::Cyclic(axis) => {
            let axis = scene.axes[*axis];
            input.config.given_pitch_mm(axis).is_none()
                && !input.config.candidates_mm(axis).is_empty()
        }
        _ => true,
    });
    let tried = |kind: Kind| last.iter().find(|c| c.kind == kind);
    kinds
        .into_iter()
        .map(|kind| NotFound {
            name: cause::kind_name(kind, scene),
            detectable_mm: tried(kind)
                .map(|c| c.detectable_mm)
                .filter(|d| d.is_finite()),
        })
        .collect()
}

/// Whether a row was searched for, with the uncertainty of its decay or frequency.
pub(super) fn nonlinear_uncertainty(
    chosen: &[Candidate],
    scene: &Scene,
    key: RowKey,
) -> Option<f64> {
    let of_row = |c: &&Candidate| c.terms.iter().any(|term| term.row(scene) == key);
    chosen.iter().find(of_row).map(|c| c.nonlinear_uncertainty)
}
