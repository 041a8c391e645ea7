//! Form of one guide that is known by its drawing: a bow, an S and a dent, each in one direction.
//!
//! ```text
//!   x = 2 (q - middle) / travel                                                              (1)
//!   f(q) = b cos(pi x / 2) + s (sin(pi x) - 3 x / pi) + d exp(-((q - q_d) / w)^2)             (2)
//!   e(q) = f(q) - f(0)                                                                       (3)
//! ```
//!
//! Rails that are screwed down at both ends bow like (2)'s first term, rails that are screwed down in the
//! middle as well like its second, about the straight line that fits it best: its slope would be another error, a lead or a
//! squareness. A joint or a crushed ball track is a dent. The axis was referenced where it stands at zero (3). A form adds to the error motions that `error_motion` draws.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | b, s, d | `bow_um_urad`, `wave_um_urad`, `dent_um_urad`: µm of a shift, µrad of a turn | µm, µrad |
//! | q_d, w | `dent_at_mm`, `dent_width_mm` | mm |

use std::f64::consts::{FRAC_PI_2, PI};

use super::error::{PlantError, require_finite, require_positive};
use super::file::GuideFormEntry;

/// One form, in one of the six error motions.
#[derive(Clone, Copy, Debug)]
pub(super) struct GuideForm {
    /// Which error motion: 0, 1, 2 a shift along X, Y, Z; 3, 4, 5 a turn about them.
    pub(super) component: usize,
    middle_mm: f64,
    half_travel_mm: f64,
    bow: f64,
    wave: f64,
    dent: f64,
    dent_at_mm: f64,
    dent_width_mm: f64,
    at_zero: f64,
}

impl GuideForm {
    /// The form of `entry` over a travel; `place` stands in errors.
    pub(super) fn new(
        place: &str,
        entry: &GuideFormEntry,
        travel_mm: [f64; 2],
    ) -> Result<Self, PlantError> {
        let at = |key: &str| format!("{place}.{key}");
        for (key, value) in [
            ("bow_um_urad", entry.bow_um_urad),
            ("wave_um_urad", entry.wave_um_urad),
            ("dent_um_urad", entry.dent_um_urad),
            ("dent_at_mm", entry.dent_at_mm),
        ] {
            require_finite(at(key), value)?;
        }
        require_positive(at("dent_width_mm"), entry.dent_width_mm)?;
        let unit = if entry.component.is_linear() {
            1e-3
        } else {
            1e-6
        };
        let mut form = Self {
            component: entry.component.index(),
            middle_mm: 0.5 * (travel_mm[0] + travel_mm[1]),
            half_travel_mm: 0.5 * (travel_mm[1] - travel_mm[0]),
            bow: entry.bow_um_urad * unit,
            wave: entry.wave_um_urad * unit,
            dent: entry.dent_um_urad * unit,
            dent_at_mm: entry.dent_at_mm,
            dent_width_mm: entry.dent_width_mm,
            at_zero: 0.0,
        };
        form.at_zero = form.at(0.0);
        Ok(form)
    }

    /// (3): mm or rad at position `q_mm`.
    pub(super) fn at(&self, q_mm: f64) -> f64 {
        let x = (q_mm - self.middle_mm) / self.half_travel_mm;
        let wave = (PI * x).sin() - 3.0 * x / PI;
        let mut form = self.bow * (FRAC_PI_2 * x).cos() + self.wave * wave;
        if self.dent.abs() > 0.0 {
            let away = (q_mm - self.dent_at_mm) / self.dent_width_mm;
            form += self.dent * (-away * away).exp();
        }
        form - self.at_zero
    }
}

#[cfg(test)]
mod tests {
    use metrology::Axis;

    use super::*;

    fn entry() -> GuideFormEntry {
        GuideFormEntry {
            component: Axis::Y,
            bow_um_urad: 4.0,
            wave_um_urad: -1.0,
            dent_um_urad: 0.0,
            dent_at_mm: 0.0,
            dent_width_mm: 10.0,
        }
    }

    #[test]
    fn eq2_a_bow_rises_in_the_middle_and_a_wave_at_the_quarters() {
        let form = GuideForm::new("form", &entry(), [-200.0, 400.0]).unwrap();
        assert_eq!(form.component, 1);
        let at = |q: f64| (form.at(q) - form.at(100.0)) * 1e3;
        let (ends, quarters) = (at(400.0) + at(-200.0), at(250.0) - at(-50.0));
        assert!((ends + 8.0).abs() < 1e-12);
        assert!((at(400.0) - at(-200.0) - 6.0 / PI).abs() < 1e-12);
        assert!((quarters + 2.0 * (1.0 - 1.5 / PI)).abs() < 1e-12);
    }

    #[test]
    fn eq2_a_wave_has_no_slope_by_least_squares() {
        let wave = GuideFormEntry {
            bow_um_urad: 0.0,
            ..entry()
        };
        let form = GuideForm::new("form", &wave, [-300.0, 300.0]).unwrap();
        let places = (0..=6000).map(|k| -300.0 + 0.1 * f64::from(k));
        let slope: f64 = places.clone().map(|q| q * form.at(q)).sum();
        let size: f64 = places.map(|q| (q * form.at(q)).abs()).sum();
        assert!((slope / size).abs() < 1e-3, "{slope} of {size}");
    }

    #[test]
    fn eq3_the_form_is_nothing_where_the_axis_was_referenced() {
        let dented = GuideFormEntry {
            dent_um_urad: 3.0,
            dent_at_mm: 20.0,
            component: Axis::C,
            ..entry()
        };
        let form = GuideForm::new("form", &dented, [-200.0, 400.0]).unwrap();
        assert!(form.at(0.0).abs() < 1e-18);
        let smooth = GuideForm::new(
            "form",
            &GuideFormEntry {
                dent_um_urad: 0.0,
                ..dented
            },
            [-200.0, 400.0],
        )
        .unwrap();
        let dent = |q: f64| (form.at(q) - form.at(300.0)) - (smooth.at(q) - smooth.at(300.0));
        assert!((dent(20.0) * 1e6 - 3.0).abs() < 1e-9);
        assert!((dent(30.0) * 1e6 - 3.0 * (-1.0_f64).exp()).abs() < 1e-9);
    }

    #[test]
    fn a_dent_without_a_width_is_refused_with_its_place() {
        let wrong = GuideFormEntry {
            dent_width_mm: 0.0,
            ..entry()
        };
        let told = GuideForm::new("geometry.linear.X.form[0]", &wrong, [0.0, 1.0]).unwrap_err();
        assert!(
            told.to_string()
                .starts_with("geometry.linear.X.form[0].dent_width_mm = 0")
        );
    }
}
