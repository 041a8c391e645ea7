//! What a machine reports of itself.

use metrology::sample::{MachineValue as Inner, Quantity, Verdict};

use crate::msg::MachineValue;
use crate::wire::{Reader, metres, time};
use crate::{Place, Wire, WireError, bounds};

const VERDICTS: [Verdict; 3] = [Verdict::Good, Verdict::Impossible, Verdict::Unconfirmed];

fn quantity_code(quantity: Quantity) -> u8 {
    match quantity {
        Quantity::Feed => MachineValue::QUANTITY_FEED,
        Quantity::SpindleSpeed => MachineValue::QUANTITY_SPINDLE_SPEED,
        Quantity::Temperature => MachineValue::QUANTITY_TEMPERATURE,
        Quantity::Load => MachineValue::QUANTITY_LOAD,
        Quantity::Override => MachineValue::QUANTITY_OVERRIDE,
        Quantity::Execution => MachineValue::QUANTITY_EXECUTION,
        Quantity::ControllerMode => MachineValue::QUANTITY_CONTROLLER_MODE,
        Quantity::Text => MachineValue::QUANTITY_TEXT,
    }
}

fn verdict_code(verdict: Verdict) -> u8 {
    match verdict {
        Verdict::Good => MachineValue::VERDICT_GOOD,
        Verdict::Impossible => MachineValue::VERDICT_IMPOSSIBLE,
        Verdict::Unconfirmed => MachineValue::VERDICT_UNCONFIRMED,
    }
}

impl Wire for MachineValue {
    type Inner = Inner;

    fn set_from_inner(&mut self, inner: &Inner) {
        self.header.stamp = time(inner.received_at);
        self.header.frame_id.clone_from(&inner.name);
        self.machine_stamp = time(inner.machine_at);
        self.quantity = quantity_code(inner.quantity);
        self.verdict = verdict_code(inner.verdict);
        self.value = match inner.quantity {
            Quantity::Feed => metres(inner.value),
            _ => inner.value,
        };
        self.text.clone_from(&inner.text);
    }

    fn to_inner(&self) -> Result<Inner, WireError> {
        let read = Reader::of::<Self>();
        let quantities = Quantity::ALL;
        let quantity = read.variant(
            "quantity",
            Place::Whole,
            self.quantity,
            &quantities,
            quantity_code,
        )?;
        Ok(Inner {
            received_at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            machine_at: read.stamp("machine_stamp", Place::Whole, &self.machine_stamp)?,
            name: read.name("header.frame_id", &self.header.frame_id)?,
            quantity,
            verdict: read.variant(
                "verdict",
                Place::Whole,
                self.verdict,
                &VERDICTS,
                verdict_code,
            )?,
            value: match quantity {
                Quantity::Feed => read.length_mm("value", self.value)?,
                quantity if quantity.is_number() => read.finite("value", self.value)?,
                _ => f64::NAN,
            },
            text: read.text("text", &self.text, bounds::SENTENCE_BYTES)?,
        })
    }
}
