//! From signatures to named causes.

use std::collections::BTreeMap;

use machine::effects::{Kind, Moment};
use machine::file::EffectEntry;

use crate::config::GapConfig;
use crate::refit::{self, Estimate};
use crate::report::{Cause, Constancy, ParameterValue, Status};
use crate::selection::{Limits, Search};
use crate::signature::{Form, Instance, Library};
use crate::stack::Stack;

/// Everything that the search found.
pub struct Found {
    /// Signatures.
    pub library: Library,
    /// Members of the best set with their values.
    pub members: Vec<Member>,
}

/// One effect of the best set.
#[derive(Clone, Debug)]
pub struct Member {
    /// Its form in the library.
    pub form: usize,
    /// Its values.
    pub estimate: Estimate,
    /// How sure.
    pub status: Status,
    /// Probability.
    pub confidence: f64,
    /// Whether it has one size.
    pub constancy: Constancy,
    /// Whitened size.
    pub d: f64,
}

/// Searches the catalogue.
pub fn find(stack: &Stack<'_>, kinds: &[&'static Kind], config: &GapConfig) -> Found {
    let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
    let instances = Instance::all(stack.twin.machine(), means);
    let library = Library::new(stack, instances);
    let normal = library.normal(&stack.z);
    let mut search = Search::new(&library, &normal, stack.z.norm_squared(), stack.freedom());
    let limits = Limits {
        beam: config.beam,
        most_effects: config.most_effects,
    };
    let best = search.run(limits);
    search.alternatives(&best, 6);
    let sizes = search.fit(&best).sizes;
    let forms: Vec<&Form> = best.iter().map(|form| &library.forms[*form]).collect();
    let estimates = refit::joint(stack, &library, &forms, &sizes);
    let members = best
        .iter()
        .zip(estimates)
        .map(|(form, estimate)| Member {
            form: *form,
            d: estimate.d,
            estimate,
            status: Status::Named,
            confidence: 1.0,
            constancy: Constancy {
                passed: true,
                worst_z: 0.0,
                split_by: String::new(),
            },
        })
        .collect();
    Found { library, members }
}

impl Found {
    /// The causes of the report.
    pub fn causes(&self) -> Vec<Cause> {
        self.members
            .iter()
            .map(|member| self.cause(member))
            .collect()
    }

    fn cause(&self, member: &Member) -> Cause {
        let instance = self.instance(member);
        let parameters = instance
            .kind
            .parameters
            .iter()
            .chain(instance.kind.free)
            .enumerate();
        Cause {
            effect: instance.kind.id.to_owned(),
            axis: instance.target.to_string(),
            status: member.status,
            confidence: member.confidence,
            parameters: parameters
                .filter(|(place, _)| member.estimate.active.contains(place))
                .map(|(place, parameter)| ParameterValue {
                    name: parameter.name.to_owned(),
                    value: member.estimate.values[place],
                    low: member.estimate.low[place],
                    high: member.estimate.high[place],
                    at_bound: member.estimate.at_bound[place],
                })
                .collect(),
            d: member.d,
            confusable_with: vec![],
            constancy: member.constancy.clone(),
        }
    }

    /// Instance of a member.
    pub fn instance(&self, member: &Member) -> &Instance {
        &self.library.instances[self.library.forms[member.form].instance]
    }

    /// The named members as entries of a machine file.
    pub fn entries(&self) -> Vec<EffectEntry> {
        let named = self
            .members
            .iter()
            .filter(|member| member.status != Status::Surrogate);
        named.map(|member| self.entry(member)).collect()
    }

    fn entry(&self, member: &Member) -> EffectEntry {
        let instance = self.instance(member);
        let target = instance.target.to_string();
        let parameters: BTreeMap<String, f64> = instance
            .kind
            .parameters
            .iter()
            .chain(instance.kind.free)
            .zip(&member.estimate.values)
            .enumerate()
            .filter(|(place, (_, value))| *place < instance.kind.parameters.len() || **value != 0.0)
            .map(|(_, (parameter, value))| (parameter.name.to_owned(), *value))
            .collect();
        EffectEntry {
            kind: instance.kind.id.to_owned(),
            axis: (!target.is_empty()).then_some(target),
            parameters,
        }
    }
}
