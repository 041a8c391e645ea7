//! What an experiment adds to what is known of some forms' columns.
//!
//! # Model
//!
//! Runs of one condition share the simulator's error of form (`form_error`): a repeat of what the session has tells the noise
//! down, and of the error of form nothing new. With K the session's runs whose conditions the experiment E repeats,
//!
//! ```text
//!   S_experiment = S(K and E together) - S(K),   S = J'J                  (1)
//! ```
//!
//! # Holds when
//! What K has in common with the rest of the session, its set-ups' floats, is left out of both terms of (1).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;
use twin::effects::Role;
use twin::{Channel, Run, Session};

use super::Bench;
use crate::noise::Noise;
use crate::noise::repeats::{self, Label, same_condition};
use crate::noise::stack::Stack;
use crate::search::signature::{Form, Library};

/// Stations of a pass: enough for what the run-to-run field leaves.
const STATIONS_OF_PASS: usize = 120;

/// (1); none where nothing of it would be read.
pub fn added(
    bench: &Bench<'_>,
    future: &Session,
    noise: &BTreeMap<Channel, Noise>,
    signatures: &Library,
    forms: &[&Form],
) -> Option<DMatrix<f64>> {
    let repeated: Vec<Run> = repeated(bench.session, future).cloned().collect();
    let n = repeated.len();
    let mut both = Session {
        runs: repeated,
        ..future.clone()
    };
    both.runs.extend(future.runs.iter().cloned());
    let of = |runs: &[usize]| gram(bench, &both, runs, noise, signatures, forms);
    let all: Vec<usize> = (0..both.runs.len()).collect();
    // An experiment of which nothing would be read adds nothing.
    let alone = of(&all[n..])?;
    if n == 0 {
        return Some(alone);
    }
    let whole = of(&all)?;
    Some(match of(&all[..n]) {
        Some(known) => whole - known,
        None => whole,
    })
}

/// The session's runs whose conditions are tested again.
fn repeated<'s>(session: &'s Session, future: &Session) -> impl Iterator<Item = &'s Run> {
    let labels =
        |run: &Run| -> BTreeSet<Label> { run.touches.iter().map(repeats::label).collect() };
    let touched: BTreeSet<Label> = future.runs.iter().flat_map(labels).collect();
    session.runs.iter().filter(move |run| {
        let is_same = future.runs.iter().any(|again| same_condition(run, again));
        is_same || !labels(run).is_disjoint(&touched)
    })
}

/// S of some runs.
fn gram(
    bench: &Bench<'_>,
    session: &Session,
    runs: &[usize],
    noise: &BTreeMap<Channel, Noise>,
    signatures: &Library,
    forms: &[&Form],
) -> Option<DMatrix<f64>> {
    let zero = |run: &Run| vec![0.0; run.readings.len()];
    let nothing: Vec<Vec<f64>> = session.runs.iter().map(zero).collect();
    let stack = Stack::new(
        session,
        bench.twin,
        runs,
        STATIONS_OF_PASS,
        noise,
        &bench.form,
        &nothing,
    );
    let mut columns = Vec::new();
    for form in forms {
        let instance = &signatures.instances[form.instance];
        for place in &form.amplitudes {
            let parameter = instance
                .kind
                .parameters
                .iter()
                .chain(instance.kind.free)
                .nth(*place)?;
            debug_assert_eq!(parameter.role, Role::Amplitude);
            let mut values = form.values.clone();
            values[*place] = parameter.typical;
            columns.push(stack.signature(&*instance.effect(&values)));
        }
    }
    if stack.rows.len == 0 || columns.is_empty() {
        return None;
    }
    let columns = DMatrix::from_columns(&columns);
    let gram = columns.tr_mul(&columns);
    gram.iter().all(|entry| entry.is_finite()).then_some(gram)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::GapConfig;
    use crate::noise::form_error::FormError;
    use crate::preflight::assumed;
    use crate::preflight::rig::{circles, floors, machine};
    use crate::search::rows::Rows;
    use crate::search::signature::Instance;
    use twin::Twin;

    /// What three circles in both senses add to what is known of a backlash from the same three, as (1) and by themselves.
    fn added_and_alone(form_error_um: f64) -> [f64; 2] {
        let machine = machine();
        let twin = Twin::new(&machine).unwrap();
        let session = circles(&machine, &[50.0], 3);
        let mut future = session.clone();
        for run in &mut future.runs {
            run.segment.run += 100;
            run.segment.setup_id += 1;
            run.segment.zero_id += 1;
        }
        let all: Vec<usize> = (0..session.runs.len()).collect();
        let rows = Rows::new(&session, &all, STATIONS_OF_PASS, |_| true);
        let noise = assumed(&rows, &floors(0.3));
        let config = GapConfig {
            form_error_um,
            ..GapConfig::default()
        };
        let bench = Bench {
            machine: &machine,
            session: &session,
            twin: &twin,
            noise: &noise,
            form: FormError::base(&config),
        };
        let kind = twin::effects::kind("backlash").unwrap();
        let instance = Instance::all(&machine, [kind].iter()).remove(0);
        let nothing: Vec<Vec<f64>> =
            (session.runs.iter().map(|run| vec![0.0; run.readings.len()])).collect();
        let stack = Stack::new(
            &session,
            &twin,
            &all,
            STATIONS_OF_PASS,
            &noise,
            &bench.form,
            &nothing,
        );
        let signatures = Library::new(&stack, vec![instance]);
        let forms = [&signatures.forms[0]];
        let added = added(&bench, &future, &noise, &signatures, &forms).unwrap();
        let alone = gram(&bench, &future, &all, &noise, &signatures, &forms).unwrap();
        [added[(0, 0)], alone[(0, 0)]]
    }

    #[test]
    fn eq1_a_repeat_tells_the_error_of_form_nothing_new() {
        let [added, alone] = added_and_alone(0.0);
        assert!((added / alone - 1.0).abs() < 1e-6, "{added} {alone}");
        let [added, alone] = added_and_alone(0.5);
        assert!(added > 0.0 && added < 0.3 * alone, "{added} {alone}");
    }
}
