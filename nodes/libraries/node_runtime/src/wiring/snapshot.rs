//! How a node is saved in the middle of a run: what its stage holds, copied.
//!
//! A table holds functions and no state, so a stage's copy is all that a node is; what a stage holds is copied as a
//! whole, by its `Clone`, from which no field can be left out.

use metrology::Stage;

use super::Wiring;
use crate::node::Saved;

type Save<S> = Box<dyn Fn(&S) -> Option<Saved> + Send>;
type Resume<S> = Box<dyn Fn(&mut S, &Saved) -> bool + Send>;

/// How a stage is copied, and put in the place of another.
pub(super) struct Snapshots<S> {
    save: Save<S>,
    resume: Resume<S>,
}

impl<S> Snapshots<S> {
    pub fn save(&self, stage: &S) -> Option<Saved> {
        (self.save)(stage)
    }

    pub fn resume(&self, stage: &mut S, saved: &Saved) -> bool {
        (self.resume)(stage, saved)
    }
}

impl<S> Wiring<S>
where
    S: Stage + Send + 'static,
    S::Input: Send + 'static,
    S::Output: Send + 'static,
{
    /// Lets the node be saved in the middle of a run.
    #[must_use]
    pub fn saved(self) -> Self
    where
        S: Clone,
    {
        let save = |stage: &S| Some(stage.clone());
        self.saved_by(save, |stage, saved: &S| stage.clone_from(saved))
    }

    /// Lets the node be saved by copies `T` of what its stage holds; `save` gives `None` when that cannot be copied now.
    #[must_use]
    pub fn saved_by<T: Send + 'static>(
        mut self,
        save: impl Fn(&S) -> Option<T> + Send + 'static,
        resume: impl Fn(&mut S, &T) + Send + 'static,
    ) -> Self {
        self.snapshots = Some(Snapshots {
            save: Box::new(move |stage| Some(Box::new(save(stage)?))),
            resume: Box::new(move |stage, saved| {
                let copy = saved.downcast_ref();
                copy.map(|copy| resume(stage, copy)).is_some()
            }),
        });
        self
    }
}
