//! Parameters of the grid encoder node; keys carry their units, limits are checked once.

use machine::Chain;
use metrology::stamp::Span;
use metrology::{Axis, ErrorComponent, PerAxis, check_between, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::basis::{Basis, ModelComponent};
use crate::error::GridEncoderError;
use crate::identify::{Disturbed, IdentifyOptions, Noise, PlateCertificate, default_basis};
use crate::recording::StationRules;
use crate::unknown::Nuisances;

/// Which positions a reading is paired with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PositionSource {
    /// Motor encoders: following errors and compensation are not taken for geometry.
    Motor,
    /// The command without compensation: what is left with the compensation on.
    Commanded,
}

/// Operational parameters; what is physical comes from the machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GridEncoderConfig {
    /// Error components to identify; empty: all of the chain's linear axes.
    pub components: Vec<String>,
    /// Greatest power of the polynomials.
    #[schemars(range(min = 1.0, max = 9.0))]
    pub greatest_power: u8,
    /// Knots of tables over the recorded span instead of polynomials, at least 3; 0: polynomials.
    #[schemars(range(min = 0.0, max = TABLE_POINTS_LIMIT))]
    pub table_points: u8,
    /// Position of X at which its errors are zero.
    #[schemars(range(min = -1e5, max = 1e5))]
    pub origin_x_mm: f64,
    /// Position of Y at which its errors are zero.
    #[schemars(range(min = -1e5, max = 1e5))]
    pub origin_y_mm: f64,
    /// Position of Z at which its errors are zero.
    #[schemars(range(min = -1e5, max = 1e5))]
    pub origin_z_mm: f64,
    /// Positions with which readings are paired: motor or commanded.
    pub positions: PositionSource,
    /// Commanded speed below which the machine stands.
    #[schemars(range(min = 1e-6, max = 1e3))]
    pub standstill_mm_min: f64,
    /// Time after a stop that is not used.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub settle_ms: f64,
    /// Fewest readings of a station, and fewest points of a recording.
    #[schemars(range(min = 2.0, max = 1e5))]
    pub least_readings: usize,
    /// Greatest distance of the command from its nominal circle.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub on_circle_um: f64,
    /// Longest time without a reading within a recording.
    #[schemars(range(min = 1.0, max = 1e6))]
    pub gap_limit_ms: f64,
    /// Points to which a moving trace is reduced; 0: every reading is one.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub bins: usize,
    /// Readings of one recording that are kept.
    #[schemars(range(min = 10.0, max = 1e7))]
    pub readings_limit: usize,
    /// Recordings that are fitted together; older ones are dropped.
    #[schemars(range(min = 1.0, max = 1e4))]
    pub recordings_limit: usize,
    /// Whether lost motion of each axis is unknown.
    pub lost_motion: bool,
    /// Whether the time between readings and positions is unknown in moving recordings.
    pub stamp_offset: bool,
    /// Whether only the radial part of readings is used, as a ballbar would give it.
    pub radial_only: bool,
    /// Whether the radius of each recording is unknown, with radial_only.
    pub radius_free: bool,
    /// Singular values below this share of the greatest count as zero.
    #[schemars(range(min = 1e-12, max = 1e-2))]
    pub rank_tolerance: f64,
    /// Residuals beyond this many standard deviations are weighed down.
    #[schemars(range(min = 2.0, max = 1e6))]
    pub outlier_limit: f64,
    /// Whether each recording has a noise of its own, at least the stated one.
    pub recording_noise: bool,
    /// Whether the plate's own error and drift between recordings are unknown, where residuals show them.
    pub plate_and_drift: bool,
    /// Expanded uncertainty (k = 2) of the plate's length, as its certificate states it.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub plate_scale_um_per_m: f64,
    /// Expanded uncertainty (k = 2) of the angle between the plate's u and v, as its certificate states it.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub plate_squareness_urad: f64,
    /// Lack of fit is reported below this p value.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lack_of_fit_limit: f64,
    /// How long the end of a recording waits for its last readings and positions, unless the next one begins and all
    /// have come.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub hold_ms: f64,
    /// Positions that wait for readings.
    #[schemars(range(min = 8.0, max = 1e6))]
    pub log_samples: usize,
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
}

/// Most knots of a table.
const TABLE_POINTS_LIMIT: f64 = 50.0;
/// Of what the plate's certificate states.
const CERTIFICATE_COVERAGE_FACTOR: f64 = 2.0;

impl Default for GridEncoderConfig {
    fn default() -> Self {
        Self {
            components: Vec::new(),
            greatest_power: 3,
            table_points: 0,
            origin_x_mm: 0.0,
            origin_y_mm: 0.0,
            origin_z_mm: 0.0,
            positions: PositionSource::Motor,
            standstill_mm_min: 1.0,
            settle_ms: 300.0,
            least_readings: 10,
            on_circle_um: 100.0,
            gap_limit_ms: 500.0,
            bins: 720,
            readings_limit: 500_000,
            recordings_limit: 64,
            lost_motion: true,
            stamp_offset: true,
            radial_only: false,
            radius_free: false,
            rank_tolerance: 1e-6,
            outlier_limit: 4.5,
            recording_noise: true,
            plate_and_drift: true,
            plate_scale_um_per_m: 0.0,
            plate_squareness_urad: 0.0,
            lack_of_fit_limit: 0.001,
            hold_ms: 200.0,
            log_samples: 4096,
            machine_file: String::new(),
        }
    }
}

impl GridEncoderConfig {
    /// Checks every value against its range.
    pub(crate) fn check(&self) -> Result<(), GridEncoderError> {
        check_parameters(self)?;
        // One knot or two have nothing between their zeros.
        if self.table_points > 0 {
            let of_knots = (3.0, TABLE_POINTS_LIMIT);
            check_between("table_points", f64::from(self.table_points), of_knots)?;
        }
        Ok(())
    }

    /// The components to identify.
    pub(crate) fn components_for(
        &self,
        chain: &Chain,
    ) -> Result<Vec<ErrorComponent>, GridEncoderError> {
        if self.components.is_empty() {
            let all = machine::volumetric::components_of(chain).into_iter();
            return Ok(all.filter(|component| component.of.is_linear()).collect());
        }
        let read = |name: &String| {
            let component = name.parse().ok();
            component
                .filter(|component| machine::volumetric::has_component(chain, *component))
                .ok_or_else(|| GridEncoderError::NoComponent {
                    name: name.clone(),
                    chain: chain.to_string(),
                })
        };
        self.components.iter().map(read).collect()
    }

    fn origin_mm(&self, axis: Axis) -> f64 {
        match axis {
            Axis::X => self.origin_x_mm,
            Axis::Y => self.origin_y_mm,
            Axis::Z => self.origin_z_mm,
            _ => 0.0,
        }
    }

    /// How to identify from these recordings, planned or made.
    ///
    /// # Errors
    /// Parameters out of range, components that the chain does not have.
    pub fn options_for(
        &self,
        chain: &Chain,
        recordings: &[crate::recording::Recording],
    ) -> Result<IdentifyOptions, GridEncoderError> {
        self.check()?;
        let components = self.components_for(chain)?;
        Ok(self.options(&components, &crate::equations::spans(recordings)))
    }

    /// How to identify `components` from recordings over `spans`.
    #[must_use]
    pub fn options(
        &self,
        components: &[ErrorComponent],
        spans: &PerAxis<(f64, f64)>,
    ) -> IdentifyOptions {
        let basis = |component: ErrorComponent| {
            let origin = self.origin_mm(component.of);
            let (least, greatest) = spans[component.of];
            if self.table_points == 0 || component.is_location || greatest <= least {
                return default_basis(component, origin, self.greatest_power);
            }
            let last = f64::from(self.table_points.max(3) - 1);
            let share = |k: u8| least + (greatest - least) * f64::from(k) / last;
            Basis::table(
                component,
                origin,
                (0..self.table_points.max(3)).map(share).collect(),
            )
        };
        let model = |&component: &ErrorComponent| ModelComponent {
            component,
            basis: basis(component),
        };
        IdentifyOptions {
            components: components.iter().map(model).collect(),
            nuisances: Nuisances {
                zero_offset: true,
                plate_rotation: !self.radial_only,
                radius: self.radial_only && self.radius_free,
                lost_motion: self.lost_motion,
                stamp_offset: self.stamp_offset,
            },
            radial_only: self.radial_only,
            rank_tolerance: self.rank_tolerance,
            outlier_limit: self.outlier_limit,
            recording_noise: self.recording_noise,
            noise: Noise::FromResiduals,
            disturbed: if self.plate_and_drift {
                Disturbed::Found { start: None }
            } else {
                Disturbed::Ignored
            },
            certificate: PlateCertificate {
                scale: self.plate_scale_um_per_m * 1e-6 / CERTIFICATE_COVERAGE_FACTOR,
                squareness_rad: self.plate_squareness_urad * 1e-6 / CERTIFICATE_COVERAGE_FACTOR,
            },
        }
    }

    pub(crate) fn station_rules(&self, resolution_mm: f64) -> StationRules {
        StationRules {
            standstill_mm_s: self.standstill_mm_min / 60.0,
            settle_s: self.settle_ms / 1e3,
            least_readings: self.least_readings,
            on_circle_mm: self.on_circle_um / 1e3,
            resolution_mm,
        }
    }

    pub(crate) fn gap_limit(&self) -> Span {
        Span::from_secs_f64(self.gap_limit_ms / 1e3)
    }

    pub(crate) fn hold(&self) -> Span {
        Span::from_secs_f64(self.hold_ms / 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let config = GridEncoderConfig {
            greatest_power: 0,
            ..GridEncoderConfig::default()
        };
        assert_eq!(
            config.check().unwrap_err().to_string(),
            "greatest_power = 0: must be from 1 to 9"
        );
        let two_knots = GridEncoderConfig {
            table_points: 2,
            ..GridEncoderConfig::default()
        };
        assert!(
            two_knots
                .check()
                .unwrap_err()
                .to_string()
                .contains("table_points")
        );
        let error = serde_saphyr::from_str::<GridEncoderConfig>("bin: 3").unwrap_err();
        assert!(error.to_string().contains("bin"));
    }

    #[test]
    fn components_that_the_chain_lacks_are_refused_by_name() {
        let chain: Chain = "[w X' Y' b Z t]".parse().unwrap();
        let with = |name: &str| GridEncoderConfig {
            components: vec![name.to_owned()],
            ..GridEncoderConfig::default()
        };
        assert_eq!(with("ECY").components_for(&chain).unwrap().len(), 1);
        for name in ["ECC", "EX0X", "rubbish", ""] {
            let message = with(name).components_for(&chain).unwrap_err().to_string();
            assert!(message.contains(&format!("\"{name}\"")), "{message}");
        }
        assert_eq!(
            GridEncoderConfig::default()
                .components_for(&chain)
                .unwrap()
                .len(),
            21
        );
    }
}
