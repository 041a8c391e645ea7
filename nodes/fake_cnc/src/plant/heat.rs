//! All heat of the machine: sources of the servo periods, gathered and spread once a second.
//!
//! ```text
//!   P_bearing = P_1000 |n/1000|^a,  P_motor likewise                              (1)
//!   P_nut = M_nut 2 pi/lead |v|,  P_guide = F_c |v|,  P_table = M_c |w|           (2)
//! ```
//!
//! Power is integrated over servo periods; each heat step of 1 s gives the energy to screws and
//! castings, which exchange heat with each other's temperatures of the step before. With the time
//! constants of castings (minutes to hours) this split is far below what matters; no heat is lost in it.

use machine::MachineFile;
use machine::file::SensorPlace;
use metrology::stamp::{NANOS_PER_S, Span};
use metrology::{Axis, PerAxis};

use super::error::{PlantError, require, require_not_negative, require_positive};
use super::file::{Place, PlantFile, SpindleLossEntry};
use super::network::Network;
use super::screw::{Screw, Surroundings};
use super::shop_air::ShopAir;
use super::thermometer::{Thermometer, nut_axis};

/// Time between heat steps, s.
pub(super) const HEAT_STEP_S: f64 = 1.0;

/// Temperature that no place of a machine tool survives, °C.
const HOTTEST_DEGC: f64 = 300.0;
/// Greatest exponent of a loss over speed; air friction has 3.
const GREATEST_EXPONENT: f64 = 5.0;

/// A screw, and which castings it stands on.
#[derive(Clone, Debug)]
struct MountedScrew {
    screw: Screw,
    nut_place: Place,
    bearing_place: Place,
    /// Force of the motor per acceleration, kN s²/mm.
    kn_per_mm_s2: f64,
    /// Sliding friction of the guides, W per mm/s.
    guide_w_per_mm_s: f64,
}

/// What a rotary drive warms.
#[derive(Clone, Copy, Debug)]
struct RotaryHeat {
    place: Place,
    w_per_rad_s: f64,
}

/// Heat of the whole machine.
#[derive(Clone, Debug)]
pub(super) struct Heat {
    pub(super) network: Network,
    air: ShopAir,
    air_degc: f64,
    screws: PerAxis<Option<MountedScrew>>,
    rotary: PerAxis<Option<RotaryHeat>>,
    thermometers: Vec<Thermometer>,
    standing_w: [f64; Place::COUNT],
    is_on: bool,
    gathered_j: [f64; Place::COUNT],
    /// Heat that the screws gave to the castings in the last step, W.
    from_screws_w: [f64; Place::COUNT],
    spindle: SpindleLossEntry,
    spindle_rpm: f64,
    /// Front bearing, rear bearing, motor at `spindle_rpm`, W.
    spindle_w: [f64; 3],
    since_step: Span,
    elapsed_s: f64,
}

impl Heat {
    pub(super) fn new(machine: &MachineFile, truth: &PlantFile) -> Result<Self, PlantError> {
        let heat = &truth.heat;
        let start_degc = heat.shop_air.start_temp_degc;
        check_spindle(&heat.spindle)?;
        let mut standing_w = [0.0; Place::COUNT];
        for (&place, &power_w) in &heat.standing_heat_w {
            require_not_negative(format!("heat.standing_heat_w.{place}"), power_w)?;
            standing_w[place as usize] = power_w;
        }
        check_spindle_heat(machine, truth, &standing_w)?;
        let mut built = Self {
            network: Network::new(heat, HEAT_STEP_S)?,
            air: ShopAir::new(&heat.shop_air, truth.seed, HEAT_STEP_S)?,
            air_degc: start_degc,
            screws: PerAxis::from_fn(|_| None),
            rotary: PerAxis::from_fn(|_| None),
            thermometers: Thermometer::all(
                machine,
                &truth.sensors,
                truth.seed,
                start_degc,
                HEAT_STEP_S,
            )?,
            standing_w,
            is_on: true,
            gathered_j: [0.0; Place::COUNT],
            from_screws_w: [0.0; Place::COUNT],
            spindle: heat.spindle.clone(),
            spindle_rpm: 0.0,
            spindle_w: [0.0; 3],
            since_step: Span::default(),
            elapsed_s: 0.0,
        };
        for &axis in heat.screws.keys() {
            if machine.linear(axis).is_none() {
                return Err(PlantError::AxisUnknown {
                    place: "heat.screws",
                    axis,
                });
            }
        }
        for &axis in machine.axes.keys() {
            if axis.is_linear() {
                built.screws[axis] = Some(mount(machine, truth, axis)?);
            } else if let Some(drive) = truth.rotary_drives.get(&axis) {
                let friction = &drive.motor_friction;
                let w_per_rad_s = friction.coulomb_n_m + drive.bearing_friction.coulomb_n_m;
                built.rotary[axis] = Some(RotaryHeat {
                    place: drive.heats,
                    w_per_rad_s,
                });
            }
        }
        Ok(built)
    }

    /// Books one servo period of a linear axis: nut, path (mm) and acceleration demand (mm/s²).
    #[inline]
    pub(super) fn rub(
        &mut self,
        axis: Axis,
        nut_mm: f64,
        path_mm: f64,
        demand_mm_s2: f64,
        period_s: f64,
    ) {
        if let Some(mounted) = &mut self.screws[axis] {
            mounted.screw.rub(
                nut_mm,
                path_mm,
                demand_mm_s2 * mounted.kn_per_mm_s2,
                period_s,
            );
            self.gathered_j[mounted.bearing_place as usize] += mounted.guide_w_per_mm_s * path_mm;
        } else if let Some(rotary) = self.rotary[axis] {
            self.gathered_j[rotary.place as usize] += rotary.w_per_rad_s * path_mm;
        }
    }

    /// Switches the sources that are always on while the machine is.
    pub(super) const fn switch(&mut self, is_on: bool) {
        self.is_on = is_on;
    }

    /// Books one servo period of the spindle.
    #[inline]
    #[expect(clippy::float_cmp, reason = "an unchanged speed needs no new power")]
    pub(super) fn spin(&mut self, spindle_rpm: f64, period_s: f64) {
        if spindle_rpm != self.spindle_rpm {
            self.spindle_rpm = spindle_rpm;
            self.spindle_w = spindle_w(&self.spindle, spindle_rpm);
        }
        self.gathered_j[Place::SpindleFront as usize] += self.spindle_w[0] * period_s;
        self.gathered_j[Place::SpindleRear as usize] += self.spindle_w[1] * period_s;
        self.gathered_j[Place::SpindleMotor as usize] += self.spindle_w[2] * period_s;
    }

    /// Lets time pass; gives whether temperatures have changed.
    #[inline]
    pub(super) fn pass(&mut self, period: Span) -> bool {
        self.since_step = Span::from_nanos(self.since_step.nanos() + period.nanos());
        let due = self.since_step.nanos() >= NANOS_PER_S;
        while self.since_step.nanos() >= NANOS_PER_S {
            self.since_step = Span::from_nanos(self.since_step.nanos() - NANOS_PER_S);
            self.step();
        }
        due
    }

    fn step(&mut self) {
        self.elapsed_s += HEAT_STEP_S;
        self.air_degc = self.air.step(self.elapsed_s);
        let mut heat_w = if self.is_on {
            self.standing_w
        } else {
            [0.0; Place::COUNT]
        };
        for (place, power_w) in heat_w.iter_mut().enumerate() {
            *power_w += self.gathered_j[place] / HEAT_STEP_S + self.from_screws_w[place];
        }
        self.gathered_j = [0.0; Place::COUNT];
        self.from_screws_w = [0.0; Place::COUNT];
        for axis in Axis::LINEAR {
            if let Some(mounted) = &mut self.screws[axis] {
                let around = Surroundings {
                    air_degc: self.air_degc,
                    nut_place_degc: self.network.temp_degc(mounted.nut_place),
                    bearing_place_degc: self.network.temp_degc(mounted.bearing_place),
                };
                let outflow = mounted.screw.step(&around, HEAT_STEP_S);
                self.from_screws_w[mounted.nut_place as usize] += outflow.into_nut_place_w;
                self.from_screws_w[mounted.bearing_place as usize] += outflow.into_bearing_place_w;
            }
        }
        self.network.step(&heat_w, self.air_degc);
        for index in 0..self.thermometers.len() {
            let true_degc = self.at_sensor_degc(self.thermometers[index].place);
            self.thermometers[index].step(true_degc);
        }
    }

    /// How far the warm screw carries the nut, mm in the axis' direction.
    #[inline]
    pub(super) fn screw_growth_mm(&self, axis: Axis, nut_mm: f64) -> f64 {
        self.screws[axis]
            .as_ref()
            .map_or(0.0, |mounted| mounted.screw.growth_mm(nut_mm))
    }

    /// True temperature where a sensor sits, °C.
    pub(super) fn at_sensor_degc(&self, place: SensorPlace) -> f64 {
        match place {
            SensorPlace::SpindleFront => self.network.temp_degc(Place::SpindleFront),
            SensorPlace::SpindleRear => self.network.temp_degc(Place::SpindleRear),
            SensorPlace::Column => self.network.temp_degc(Place::ColumnFront),
            SensorPlace::Bed => self.network.temp_degc(Place::Bed),
            SensorPlace::Ambient => self.air_degc,
            SensorPlace::NutX | SensorPlace::NutY | SensorPlace::NutZ => nut_axis(place)
                .and_then(|axis| self.screws[axis].as_ref())
                .map_or(self.air_degc, |mounted| mounted.screw.nut_degc()),
        }
    }

    /// Reads the sensor `id`, °C.
    pub(super) fn read_degc(&mut self, id: &str) -> Option<f64> {
        self.thermometers
            .iter_mut()
            .find(|sensor| sensor.id == id)
            .map(Thermometer::read_degc)
    }
}

fn mount(machine: &MachineFile, truth: &PlantFile, axis: Axis) -> Result<MountedScrew, PlantError> {
    let place = "heat.screws";
    let missing = |place| PlantError::AxisMissing { place, axis };
    let entry = truth.heat.screws.get(&axis).ok_or(missing(place))?;
    let drive = truth
        .linear_drives
        .get(&axis)
        .ok_or(missing("linear_drives"))?;
    let linear = machine.linear(axis).ok_or(missing("axes"))?;
    require_positive(format!("axes.{axis}.lead_mm"), linear.lead_mm)?;
    let at = |key: &str| format!("{place}.{axis}.{key}");
    let [low_mm, high_mm] = linear.travel_mm;
    let covered = "outside the axis' travel";
    require(
        entry.ends_mm[0] <= low_mm,
        at("ends_mm[0]"),
        entry.ends_mm[0],
        covered,
    )?;
    require(
        entry.ends_mm[1] >= high_mm,
        at("ends_mm[1]"),
        entry.ends_mm[1],
        covered,
    )?;
    let heat = &truth.heat;
    let screw = Screw::new(
        &format!("{place}.{axis}"),
        entry,
        linear.lead_mm,
        heat.reference_temp_degc,
        heat.shop_air.start_temp_degc,
    )?;
    Ok(MountedScrew {
        screw,
        nut_place: entry.nut_place,
        bearing_place: entry.bearing_place,
        kn_per_mm_s2: (drive.motor_inertia_kg + drive.slide_mass_kg) * 1e-6,
        guide_w_per_mm_s: drive.guide_friction.coulomb_n / 1e3,
    })
}

/// (1): front bearing, rear bearing, motor.
fn spindle_w(entry: &SpindleLossEntry, spindle_rpm: f64) -> [f64; 3] {
    let thousands = spindle_rpm.abs() / 1e3;
    let bearing = thousands.powf(entry.bearing_exponent);
    [
        entry.front_bearing_w_at_1000_rpm * bearing,
        entry.rear_bearing_w_at_1000_rpm * bearing,
        entry.motor_w_at_1000_rpm * thousands.powf(entry.motor_exponent),
    ]
}

/// At its greatest speed the spindle must settle at a temperature that a machine survives.
fn check_spindle_heat(
    machine: &MachineFile,
    truth: &PlantFile,
    standing_w: &[f64; Place::COUNT],
) -> Result<(), PlantError> {
    let Some(spindle) = &machine.spindle else {
        return Ok(());
    };
    let heat = &truth.heat;
    let [front, rear, motor] = spindle_w(&heat.spindle, spindle.max_speed_rpm);
    let mut heat_w = *standing_w;
    heat_w[Place::SpindleFront as usize] += front;
    heat_w[Place::SpindleRear as usize] += rear;
    heat_w[Place::SpindleMotor as usize] += motor;
    let settled = Network::settled_degc(heat, &heat_w, heat.shop_air.start_temp_degc)?;
    let hottest = Place::ALL
        .into_iter()
        .map(|place| {
            (
                place,
                settled.map_or(f64::INFINITY, |all| all[place as usize]),
            )
        })
        .max_by(|(_, a), (_, b)| a.total_cmp(b));
    match hottest {
        // Written so that a temperature that is no number is refused as well.
        Some((_, temp_degc)) if temp_degc <= HOTTEST_DEGC => Ok(()),
        Some((place, temp_degc)) => Err(PlantError::TooHot {
            speed_rpm: spindle.max_speed_rpm,
            place,
            temp_degc: temp_degc.round(),
            limit_degc: HOTTEST_DEGC,
        }),
        None => Ok(()),
    }
}

fn check_spindle(entry: &SpindleLossEntry) -> Result<(), PlantError> {
    let at = |key: &str| format!("heat.spindle.{key}");
    require_not_negative(
        at("front_bearing_w_at_1000_rpm"),
        entry.front_bearing_w_at_1000_rpm,
    )?;
    require_not_negative(
        at("rear_bearing_w_at_1000_rpm"),
        entry.rear_bearing_w_at_1000_rpm,
    )?;
    require_not_negative(at("motor_w_at_1000_rpm"), entry.motor_w_at_1000_rpm)?;
    for (key, exponent) in [
        ("bearing_exponent", entry.bearing_exponent),
        ("motor_exponent", entry.motor_exponent),
    ] {
        let holds = exponent > 0.0 && exponent <= GREATEST_EXPONENT;
        require(holds, at(key), exponent, "above 0 and at most 5")?;
    }
    Ok(())
}
