//! Which fault of a machine makes a circle out of round, by how much, and what would be left without it.
//!
//! # Model
//!
//! Where the tool should be at (R cos θ, R sin θ) about the centre, an error (e₁, e₂) of the two axes
//! (actual minus commanded) is seen by a radial measurement as
//!
//! ```text
//!   ρ(θ) = e₁ cos θ + e₂ sin θ                                                        (1)
//! ```
//!
//! With σ = +1 counter-clockwise and −1 clockwise, v the feed, x' and y' measured from the centre of
//! the first recording, each cause is one row:
//!
//! | row | ρ on a circle about that centre | unit of the value |
//! |---|---|---|
//! | centre offset (setting up) | c₁ cos θ + c₂ sin θ | mm |
//! | reference length (setting up) | l | mm |
//! | radial expansion | R (s₁ + s₂)/2 | mm/mm |
//! | scaling mismatch | (R/2)(s₁ − s₂) cos 2θ | mm/mm |
//! | squareness | −(s R φ/2) sin 2θ; φ the component of ISO 230-1, s of [`metrology::squareness`] | rad |
//! | servo mismatch | σ (v/2)(T₁ − T₂) sin 2θ | s |
//! | radius contraction | −v² T²/(2R) | s² |
//! | backlash | step outward by b after each reversal, four numbers: [`BacklashEnd`] | mm |
//! | lateral play | σ (l/2)\|sin θ\|, σ (l/2)\|cos θ\| | mm |
//! | reversal spike | A p(t/τ) \|cos θ\|, t since the reversal; pulse p and τ by search | mm |
//! | cyclic | a cos θ sin(2π x/p + ψ); p given or searched | mm |
//! | straightness | k x'² sin θ, three lobes (k R²/4) sin 3θ once centred | 1/mm |
//! | quadratic pitch error | k x'² cos θ | 1/mm |
//! | vibration | A sin(2π f t + ψ), f by a periodogram | mm |
//! | drift | linear in time, a seam where the circle closes | mm/s |
//!
//! All recordings of a plane are fitted at once with the same machine and their own centre and, where
//! it is not calibrated, reference length. Planes are fitted apart.
//!
//! # What is told apart
//!
//! Columns are taken in the order of the table. One whose angle to the span of those before has a sine
//! below `least_sine` is not told apart from them: the row that is printed is then the combination that the
//! data see, with its coefficients, and with the recordings that would split it. These are found by
//! adding them to the design and judging it again.
//!
//! # Holds when
//! Deviations are small beside the radius, the angle is that of the point and the feed is reached on
//! the whole circle. Unequal lags also make an oval along the axes of 1.5 T̄ (T₁ − T₂) v²/R, which is
//! booked as scaling mismatch.
//!
//! # Agreement
//! Against a machine simulated in time, which knows none of these formulas (`tests/it/breakdown`), with 0.1 µm
//! noise on six circles of both senses, two feeds and two radii: each cause alone is the first row;
//! linear rows within 1 to 2 %, a LuGre friction pulse within 40 % of its height, a vibration within
//! 0.005 Hz. 95 % intervals of the linear rows hold the truth in 93 to 97 % of 1,000 noises.
//! A search in a tenth of the rows gives the rows of all samples to a quarter of their uncertainties
//! (`samples_taken_together_give_the_rows_of_all_samples`).
//! `val_first_order_lag_contraction_is_the_closed_form`: 0.1 %.
//! `val_unequal_lags_make_half_the_feed_times_their_difference`: 0.2 %.
//!
//! # References
//! \[1\] ISO 230-4:2022. \[2\] S. J. Yutkowitz, US 6,850,806 B2 (what-if after removing one source).
//! \[3\] MTS Northwest, "Analyzing your results" (ball bar inspection): four-point squareness and diameters.

mod backlash;
mod cause;
mod centre;
mod columns;
mod config;
mod contribution;
mod cross_check;
mod cyclic;
mod distinguish;
mod drift;
mod error;
mod instrument;
mod lateral;
mod maximum;
mod noise;
mod periodogram;
mod plane;
mod projector;
mod recording;
mod report;
mod robust;
mod scale;
mod scene;
mod search;
mod servo;
mod spectrum;
mod spike;
mod squareness;
mod straightness;
mod term;
mod thin;
mod tone;

pub use config::{AxisPitch, BreakdownConfig, Pitch};
pub use cross_check::CrossCheck;
pub use error::BreakdownError;
pub use instrument::Instrument;
pub use recording::{
    CircularPlane, CircularRecording, CircularSample, CircularSense, GREATEST_DEVIATION,
    ReferenceLength, outliers,
};
pub use report::{
    Alias, Breakdown, Detail, Needed, Noise, NotFound, PlaneBreakdown, RecordingSummary, Row, Unit,
};
pub use term::{BacklashEnd, RowKey};

/// Breaks circular recordings down into the faults of the machine, plane by plane.
///
/// # Errors
/// No recording, numbers that cannot be used, an angle that runs against the stated sense, a
/// configuration out of its limits. Never for what the data cannot tell apart.
pub fn evaluate(
    recordings: &[CircularRecording],
    config: &BreakdownConfig,
) -> Result<Breakdown, BreakdownError> {
    evaluate_with(recordings, &[], config)
}

/// The same with the errors of what read each recording in the uncertainties of the rows; no instruments: of the fit alone.
///
/// # Errors
/// As [`evaluate`], and another number of instruments than of recordings.
pub fn evaluate_with(
    recordings: &[CircularRecording],
    instruments: &[Instrument],
    config: &BreakdownConfig,
) -> Result<Breakdown, BreakdownError> {
    config.check()?;
    if !instruments.is_empty() && instruments.len() != recordings.len() {
        let (n, recordings) = (instruments.len(), recordings.len());
        return Err(BreakdownError::InstrumentCount { n, recordings });
    }
    for (index, instrument) in instruments.iter().enumerate() {
        instrument.check(index)?;
    }
    if recordings.is_empty() {
        return Err(BreakdownError::NoRecordings);
    }
    for (index, recording) in recordings.iter().enumerate() {
        recording.check(index)?;
    }
    let planes = CircularPlane::ALL
        .into_iter()
        .map(|plane| {
            let of_plane = recordings
                .iter()
                .enumerate()
                .filter(|(_, r)| r.plane == plane);
            (plane, of_plane.collect::<Vec<_>>())
        })
        .filter(|(_, of_plane)| !of_plane.is_empty())
        .map(|(plane, of_plane)| plane::evaluate(plane, &of_plane, instruments, config))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Breakdown { planes })
}
