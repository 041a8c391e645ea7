//! The services of a managed node.

use abbe_msgs::lifecycle_msgs::msg::TransitionDescription;
use abbe_msgs::lifecycle_msgs::srv::{
    ChangeState, ChangeStateRequest, ChangeStateResponse, GetAvailableStates,
    GetAvailableStatesResponse, GetAvailableTransitions, GetAvailableTransitionsResponse, GetState,
    GetStateResponse,
};
use abbe_msgs::{Service, to_cdr};
use metrology::Stage;
use metrology::stamp::{Host, Stamp};

use super::Managed;
use crate::lifecycle::{State, Transition};
use crate::node::{Bytes, Emission, Refusal, RequestId, ServiceEvents, ServicePort};
use crate::wiring::{decode, encode};

/// The services, in the order in which they stand behind the stage's own.
#[derive(Clone, Copy)]
pub(super) enum Call {
    ChangeState,
    GetState,
    AvailableStates,
    AvailableTransitions,
    TransitionGraph,
}

impl Call {
    pub const ALL: [Self; 5] = [
        Self::ChangeState,
        Self::GetState,
        Self::AvailableStates,
        Self::AvailableTransitions,
        Self::TransitionGraph,
    ];

    pub fn port(self, node: &str) -> ServicePort {
        match self {
            Self::ChangeState => port::<ChangeState>(node, "change_state"),
            Self::GetState => port::<GetState>(node, "get_state"),
            Self::AvailableStates => port::<GetAvailableStates>(node, "get_available_states"),
            Self::AvailableTransitions => {
                port::<GetAvailableTransitions>(node, "get_available_transitions")
            }
            Self::TransitionGraph => port::<GetAvailableTransitions>(node, "get_transition_graph"),
        }
    }
}

fn port<V: Service>(node: &str, name: &str) -> ServicePort {
    ServicePort {
        service: format!("{node}/{name}"),
        type_name: V::TYPE_NAME,
        events: ServiceEvents::of::<V>(),
    }
}

/// The answer to who asked for a step.
pub(super) fn changed(success: bool) -> Bytes {
    Bytes::from(to_cdr(&ChangeStateResponse { success }))
}

fn listed(available_transitions: Vec<TransitionDescription>) -> Bytes {
    encode(&GetAvailableTransitionsResponse {
        available_transitions,
    })
}

impl<S> Managed<S>
where
    S: Stage + Send + 'static,
    S::Input: Send + 'static,
    S::Output: Send + 'static,
{
    /// Answers, now or when the step has ended.
    pub(super) fn asked(
        &mut self,
        at: Stamp<Host>,
        call: Call,
        by: (usize, RequestId),
        bytes: &[u8],
        out: &mut Vec<Emission>,
    ) -> Result<(), Refusal> {
        let mut taken = Ok(());
        let answer = match call {
            Call::ChangeState => {
                let request = decode::<ChangeStateRequest>(bytes);
                let state = self.standing.state;
                let step = { request.as_ref().ok() }
                    .and_then(|request| Transition::wanted(state, &request.transition));
                if let Some(step) = step {
                    self.standing.waiting = Some(by);
                    self.begin(at, step, out);
                    return Ok(());
                }
                // What cannot be read is answered as well.
                taken = request.map(drop);
                changed(false)
            }
            Call::GetState => encode(&GetStateResponse {
                current_state: self.standing.state.message(),
            }),
            Call::AvailableStates => encode(&GetAvailableStatesResponse {
                available_states: State::ALL.map(State::message).into(),
            }),
            Call::AvailableTransitions => {
                let steps = Transition::of(self.standing.state).map(|step| step.description());
                listed(steps.collect())
            }
            Call::TransitionGraph => listed(Transition::ALL.map(Transition::description).into()),
        };
        let (service, id) = by;
        out.push(Emission::Respond {
            service,
            id,
            bytes: answer,
        });
        taken
    }
}
