//! Which turn of a circle was evaluated and what was left out, for a reader and for a program.

use serde_json::{Value, json};

use crate::evaluate::circles::{CircleRecording, EvaluatedTurn, SETTLING_S, TurnBy};

/// Time at feed that is stated, s: below it lies the time between two readings.
const LATE_S: f64 = 0.1;

/// One sentence or two for each recording.
pub fn lines(circles: &[&CircleRecording]) -> Vec<String> {
    let line = |circle: &&CircleRecording| in_words(circle.segment.run, &circle.turn);
    circles.iter().map(line).collect()
}

/// The same for `report.json`.
pub fn figures(circles: &[&CircleRecording]) -> Vec<Value> {
    let figure = |circle: &&CircleRecording| {
        let EvaluatedTurn {
            by,
            left_out_s,
            left_out_rad,
            n_left_out,
        } = circle.turn;
        json!({
            "run": circle.segment.run,
            "by": by,
            "readings": circle.points.len(),
            "left_out_s": left_out_s,
            "left_out_rad": left_out_rad,
            "n_left_out": n_left_out,
        })
    };
    circles.iter().map(figure).collect()
}

fn in_words(run: u32, turn: &EvaluatedTurn) -> String {
    let how = match turn.by {
        TurnBy::FullRate => {
            "evaluated is the turn that the control recorded at its full rate, as (rate: full) of the program asks".to_owned()
        }
        TurnBy::Settling if turn.left_out_s > SETTLING_S + LATE_S => format!(
            "evaluated is one turn from {:.2} s after the feed was reached; the position loops have settled after {SETTLING_S} s",
            turn.left_out_s
        ),
        TurnBy::Settling => format!(
            "evaluated is one turn from {SETTLING_S} s after the feed was reached, when the position loops have settled"
        ),
        TurnBy::TooShort => format!(
            "evaluated is the last turn, and its first readings may be unsettled: no whole turn follows {SETTLING_S} s after the feed was reached"
        ),
    };
    let has_unread = turn.left_out_s > LATE_S;
    let left_out = if turn.n_left_out == 0 && has_unread {
        format!(
            "No reading was left out: {:.2} s and {:.1}° at feed before it have none.",
            turn.left_out_s,
            turn.left_out_rad.to_degrees()
        )
    } else if turn.n_left_out == 0 {
        "No reading was left out.".to_owned()
    } else {
        format!(
            "Left out at feed: {:.2} s and {:.1}° before it; {} readings before and behind it.",
            turn.left_out_s,
            turn.left_out_rad.to_degrees(),
            turn.n_left_out
        )
    };
    format!("Run {run}: {how}. {left_out}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_says_what_was_left_out_and_why() {
        let turn = EvaluatedTurn {
            by: TurnBy::Settling,
            left_out_s: 0.5,
            left_out_rad: std::f64::consts::FRAC_PI_4,
            n_left_out: 25,
        };
        assert_eq!(
            in_words(5, &turn),
            "Run 5: evaluated is one turn from 0.5 s after the feed was reached, when the position loops have settled. Left out at feed: 0.50 s and 45.0° before it; 25 readings before and behind it."
        );
        let short = EvaluatedTurn {
            by: TurnBy::TooShort,
            ..turn
        };
        assert!(in_words(5, &short).contains("may be unsettled"));
        let whole = EvaluatedTurn {
            left_out_s: 0.0,
            left_out_rad: 0.0,
            n_left_out: 0,
            ..turn
        };
        assert!(in_words(5, &whole).ends_with("No reading was left out."));
        // An instrument that began to read 9.40 s after the feed was reached: 0.2 rad/s, 107.7°.
        let late = EvaluatedTurn {
            left_out_s: 9.40,
            left_out_rad: 1.88,
            n_left_out: 0,
            ..turn
        };
        assert_eq!(
            in_words(5, &late),
            "Run 5: evaluated is one turn from 9.40 s after the feed was reached; the position loops have settled after 0.5 s. No reading was left out: 9.40 s and 107.7° at feed before it have none."
        );
    }
}
