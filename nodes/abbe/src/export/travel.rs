//! How far each axis moves, by the machine file of the bag.

use control_tables::Travels;
use metrology::PerAxis;
use node_runtime::complain;
use recorder::Bag;
use reports::machine_of_bag;

/// Travel of each axis, mm or rad; none without a machine file. One that cannot be read is a loss.
pub(super) fn of(bag: &Bag, losses: &mut Vec<String>) -> Travels {
    let machine = match machine_of_bag::of(bag) {
        Ok(Some((machine, _))) => machine,
        Ok(None) => {
            complain!(
                "abbe: the bag has no machine file: points are not compared with the travel of the axes; record with --machine FILE"
            );
            return PerAxis::default();
        }
        Err(why) => {
            losses.push(format!(
                "points are not compared with the travel of the axes: {why}"
            ));
            return PerAxis::default();
        }
    };
    PerAxis::from_fn(|axis| {
        let linear = machine.linear(axis).map(|entry| entry.travel_mm);
        let rotary = machine
            .rotary_axis(axis)
            .map(|entry| entry.travel_deg.map(f64::to_radians));
        linear.or(rotary).map(|[least, greatest]| (least, greatest))
    })
}
