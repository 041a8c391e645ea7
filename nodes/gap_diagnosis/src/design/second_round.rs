//! The best small programme for what a diagnosis left open: experiments that it proposes, within a time.
//!
//! Each proposal decides questions that no earlier one does, so that what several decide adds up. All sets of the first
//! [`MOST_PROPOSALS`] are compared.

use crate::report::NextExperiment;

/// Proposals that are looked at: a report has about as many.
pub const MOST_PROPOSALS: usize = 12;

/// Places of the proposals that together decide most within some minutes; of equal ones the shortest.
#[must_use]
pub fn second_round(next: &[NextExperiment], minutes: f64) -> Vec<usize> {
    let n = next.len().min(MOST_PROPOSALS);
    let members = |set: u32| (0..n).filter(move |place| set & (1 << place) != 0);
    let mut best = (0, 0.0, 0_u32);
    for set in 1..1_u32 << n {
        let decided: usize = members(set).map(|place| next[place].separates.len()).sum();
        let took_min: f64 = members(set).map(|place| next[place].minutes).sum();
        if took_min > minutes + 1e-9 {
            continue;
        }
        if decided > best.0 || (decided == best.0 && decided > 0 && took_min < best.1) {
            best = (decided, took_min, set);
        }
    }
    members(best.2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proposal(run: &str, separates: usize, minutes: f64) -> NextExperiment {
        NextExperiment {
            run: run.to_owned(),
            separates: vec!["backlash X".to_owned(); separates],
            delta: 20.0,
            minutes,
        }
    }

    #[test]
    fn several_short_tests_go_before_a_long_one_that_decides_less() {
        let next = [
            proposal("long", 3, 14.0),
            proposal("short", 2, 6.0),
            proposal("other", 2, 8.0),
        ];
        assert_eq!(second_round(&next, 15.0), [1, 2]);
        assert_eq!(second_round(&next, 28.0), [0, 1, 2]);
        assert_eq!(second_round(&next, 7.0), [1]);
        assert_eq!(second_round(&next, 5.0), Vec::<usize>::new());
        assert_eq!(second_round(&[], 15.0), Vec::<usize>::new());
    }

    #[test]
    fn of_equal_sets_the_shortest_is_taken() {
        let next = [proposal("a", 2, 9.0), proposal("b", 2, 4.0)];
        assert_eq!(second_round(&next, 10.0), [1]);
    }
}
