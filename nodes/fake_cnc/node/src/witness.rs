//! A scenario's look at the plant's truth; it reaches no topic and no node.

use fake_cnc::{Cnc, CncError, Input, Output};
use metrology::{Author, Host, Stage, Stamp};

/// Called after every step in which time passed.
pub type Witness = Box<dyn FnMut(Stamp<Host>, &Cnc) + Send>;

/// The machine with somebody looking on.
pub(crate) struct Witnessed {
    pub cnc: Cnc,
    pub witness: Option<Witness>,
}

impl Witnessed {
    /// The offsets that come next are of this publisher.
    pub fn hears(&mut self, at: Stamp<Host>, author: Author) {
        self.cnc.hears(at, author);
    }
}

impl Stage for Witnessed {
    type Input = Input;
    type Output = Output;
    type Error = CncError;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), CncError> {
        let time_passes = input == Input::Tick;
        self.cnc.step(at, input, out)?;
        if let (true, Some(witness)) = (time_passes, &mut self.witness) {
            witness(at, &self.cnc);
        }
        Ok(())
    }
}
