//! At which temperature the lengths of a table hold, as a person reads it who decides whether to load the table.

use metrology::number::number;
use metrology::sample::PositioningTable;
use reports::evaluate::correction::Correction;

/// Expansion of a screw or scale of steel, µm/(m K): where nothing is stated, it shows how much the temperature matters.
const NOMINAL_EXPANSION_UM_PER_M_K: f64 = 11.0;

/// Whether lengths are those at 20 °C, for the line of what a table is made of.
pub(super) fn state(correction: &Correction) -> &'static str {
    match correction {
        Correction::Here { .. } => "corrected to 20 °C by --budget",
        Correction::ByInstrument => "corrected to 20 °C by the instrument",
        Correction::Missing { .. } => "not corrected to 20 °C",
    }
}

/// What a reader of the table must know: temperatures, coefficients and the correction at both ends, or what a kelvin changes.
pub(super) fn remark(correction: &Correction, table: &PositioningTable) -> String {
    let axis = table.axis;
    let ends = table.position.first().zip(table.position.last());
    let (first_mm, last_mm) = ends.map_or((0.0, 0.0), |(first, last)| (*first, *last));
    let span_mm = last_mm - first_mm;
    match correction {
        Correction::Here {
            differential_expansion,
            ..
        } => format!(
            "positioning of {axis}: {} Added to the errors as read: 0.00 µm at {} mm, {:+.2} µm at {} mm. Load it where the control compensates the temperature itself; elsewhere the axis is right at 20 °C alone",
            correction.in_words(span_mm),
            number(first_mm),
            -differential_expansion * span_mm * 1e3,
            number(last_mm),
        ),
        Correction::ByInstrument => {
            format!("positioning of {axis}: {}", correction.in_words(span_mm))
        }
        Correction::Missing { reason } => format!(
            "positioning of {axis}: not corrected to 20 °C ({reason}): right at the temperature of the measurement; 1 K changes {} mm, the farthest target from the first, by {:.2} µm, with the nominal {} µm/(m K) of steel (a machine file states no expansion). For 20 °C give --budget FILE with the temperatures and the expansion",
            number(span_mm),
            NOMINAL_EXPANSION_UM_PER_M_K * span_mm * 1e-3,
            number(NOMINAL_EXPANSION_UM_PER_M_K),
        ),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use metrology::Axis;
    use metrology::stamp::Stamp;
    use reports::evaluate::Tests;
    use reports::evaluate::budget::Budget;
    use reports::evaluate::correction::{About, Measured};

    use super::*;

    const BUDGET: &str = "
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 2.0, temperature_half_width_k: 0.2, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.0
";

    /// Of X, from -100 to 300 mm.
    fn table() -> PositioningTable {
        PositioningTable {
            at: Stamp::from_nanos(0),
            axis: Axis::X,
            position: vec![-100.0, 300.0],
            deviation_up: vec![0.0; 2],
            deviation_down: vec![0.0; 2],
            n_runs: 5,
            weight: 0.0,
            sequence: 0,
        }
    }

    fn said(text: Option<&str>) -> String {
        let budget = text.map(|text| Budget::read(text, Path::new("budget.yaml")).unwrap());
        let about = About::lengths(&[]);
        let measured = Measured::of(&Tests::default(), budget.as_ref(), about);
        remark(&measured.correction, &table())
    }

    #[test]
    fn a_corrected_table_states_temperatures_coefficients_and_both_ends_by_hand() {
        // 11 µm/(m K) · 2 K · 0.4 m = 8.8 µm.
        let said = said(Some(BUDGET));
        for words in [
            "positioning of X: Corrected to 20 °C: 8.80 µm taken out over 400 mm; machine 22.00 °C",
            "11.0 µm/(m K), device without expansion",
            "0.00 µm at -100 mm, -8.80 µm at 300 mm",
            "Load it where the control compensates the temperature itself",
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
    }

    #[test]
    fn a_table_that_is_not_corrected_states_what_a_kelvin_changes_by_hand() {
        // 11 µm/(m K) · 0.4 m = 4.4 µm/K.
        let without = said(None);
        for words in [
            "not corrected to 20 °C (no budget was given (--budget))",
            "1 K changes 400 mm, the farthest target from the first, by 4.40 µm, with the nominal 11 µm/(m K)",
        ] {
            assert!(without.contains(words), "{words}: {without}");
        }
        let unread = BUDGET.replace("temperature_deviation_k: 2.0", "thermometers: [bed]");
        let unread = said(Some(&unread));
        let words = "names the thermometer bed, which has no reading during this test; no thermometer was read): right at";
        assert!(unread.contains(words), "{unread}");
        let own = format!("{BUDGET}length_corrected_by_instrument: true\n");
        let own = said(Some(&own));
        assert!(
            own.contains("Corrected to 20 °C by the instrument"),
            "{own}"
        );
    }
}
