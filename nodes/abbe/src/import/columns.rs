//! The columns that each test of a map needs.

use super::map::{Column, Test, What, units};
use super::units::Unit;

impl Test {
    /// The columns that the test needs.
    pub fn columns(&self) -> Vec<Column<'_>> {
        match self {
            Self::Positioning { .. } => self.of_positioning(),
            Self::Circle {
                run,
                angle_deg,
                radial_um,
                ..
            } => vec![
                column(run, What::Run),
                column(angle_deg, What::Place(Unit::Deg)),
                column(radial_um, What::Deviation(Unit::Um)),
            ],
            Self::Touches {
                x_mm,
                y_mm,
                z_mm,
                run,
                feature,
                time_s,
            } => {
                let run = run.iter().map(|name| column(name, What::Run));
                let feature = feature.iter().map(|name| column(name, What::Feature));
                let axes = [x_mm, y_mm, z_mm].map(|name| column(name, What::Place(Unit::Mm)));
                let time = time_s.iter().map(|name| column(name, What::Time));
                run.chain(feature).chain(axes).chain(time).collect()
            }
            Self::Log {
                run,
                time_s,
                displacement_um,
                second_displacement_um,
                temperature_degc,
                ..
            } => {
                let run = run.iter().map(|name| column(name, What::Run));
                let displacement = |name| column(name, What::Deviation(Unit::Um));
                let fixed = [column(time_s, What::Time), displacement(displacement_um)];
                let second = second_displacement_um.iter();
                let fixed = fixed
                    .into_iter()
                    .chain(second.map(|name| displacement(name)));
                let sensors = temperature_degc.values();
                let sensors = sensors.map(|name| column(name, What::Temperature));
                run.chain(fixed).chain(sensors).collect()
            }
        }
    }

    fn of_positioning(&self) -> Vec<Column<'_>> {
        let Self::Positioning {
            axis,
            run,
            target_mm,
            deviation_um,
            measured_mm,
            passes_um,
            direction,
            ..
        } = self
        else {
            return vec![];
        };
        let [place, deviation] = units(*axis).of_cells;
        let run = run.iter().map(|name| column(name, What::Run));
        let read = deviation_um.iter();
        let read = read.map(|name| column(name, What::Deviation(deviation)));
        let measured = measured_mm.iter();
        let measured = measured.map(|name| column(name, What::Measured(place)));
        let passes = passes_um.iter();
        let passes = passes.map(|pass| column(&pass.column, What::Deviation(deviation)));
        let direction = direction.iter();
        let direction = direction.map(|name| column(name, What::Direction));
        run.chain([column(target_mm, What::Place(place))])
            .chain(read)
            .chain(measured)
            .chain(passes)
            .chain(direction)
            .collect()
    }
}

const fn column(name: &str, what: What) -> Column<'_> {
    Column { name, what }
}
