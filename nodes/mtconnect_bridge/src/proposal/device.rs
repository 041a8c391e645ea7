//! The data items of the one device that a mapping is for.

use std::collections::BTreeMap;

use super::described;
use crate::document::{DataItem, Device};
use crate::error::BridgeError;

/// The items of one device; of an agent's only device, where none is named.
///
/// # Errors
/// When there are several devices, or none of that name, with the names that there are; two devices of that name; an id
/// that two data items have, since an agent's values would be mixed.
pub fn of_device(
    devices: &[Device],
    items: &[DataItem],
    name: Option<&str>,
) -> Result<Vec<DataItem>, BridgeError> {
    let named = |wanted: &dyn Fn(&Device) -> bool| -> Vec<String> {
        let chosen = devices.iter().filter(|device| wanted(device));
        let mut names: Vec<String> = chosen.map(|device| device.name.clone()).collect();
        names.sort();
        names
    };
    let machines = named(&|device| !device.is_of_agent);
    let chosen = match (name, machines.as_slice()) {
        (Some(name), _) => name,
        (None, [only]) => only,
        (None, []) => return unique(items.to_vec()),
        (None, _) => return Err(BridgeError::Devices { names: machines }),
    };
    match named(&|device| device.name == chosen).len() {
        0 => Err(BridgeError::NoDevice {
            name: chosen.to_owned(),
            names: named(&|_| true),
        }),
        1 => {
            let found = items.iter().filter(|item| item.device == chosen);
            unique(found.cloned().collect())
        }
        count => Err(BridgeError::DeviceTwice {
            name: chosen.to_owned(),
            count,
        }),
    }
}

/// Data items, each of which has an id of its own.
fn unique(items: Vec<DataItem>) -> Result<Vec<DataItem>, BridgeError> {
    let mut by_id: BTreeMap<&str, Vec<&DataItem>> = BTreeMap::new();
    for item in &items {
        by_id.entry(&item.id).or_default().push(item);
    }
    let twice = by_id.into_iter().filter(|(_, items)| items.len() > 1);
    let ids: Vec<String> = twice
        .map(|(id, items)| {
            let all: Vec<_> = items
                .iter()
                .map(|item| described(item).trim_start().to_owned())
                .collect();
            format!("{id:?}: {}", all.join(" and "))
        })
        .collect();
    if ids.is_empty() {
        Ok(items)
    } else {
        Err(BridgeError::IdTwice { ids })
    }
}
