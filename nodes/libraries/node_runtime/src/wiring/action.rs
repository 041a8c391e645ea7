//! Actions in the table of a node: the server's and the client's side.

use abbe_msgs::topics::ActionName;
use abbe_msgs::{Action, GetResultResponse};
use metrology::Stage;

use super::{Wiring, decode, encode};
use crate::node::{ActionPort, Emission, Event, GoalId, GoalStatus, Refusal};

/// What a stage that offers an action says of a goal.
pub enum GoalSignal<A: Action> {
    /// It takes the goal.
    Accept(GoalId),
    /// It refuses the goal.
    Reject(GoalId),
    /// News of the goal.
    Feedback(GoalId, A::Feedback),
    /// The goal ended.
    Finish(GoalId, GoalStatus, A::Result),
}

/// What a stage that uses an action wants.
pub enum ClientSignal<A: Action> {
    /// Propose a goal under a number of the stage's own choice.
    Send(GoalId, A::Goal),
    /// Call the goal off.
    Cancel(GoalId),
}

/// What a stage that uses an action is told.
pub enum GoalNews<A: Action> {
    /// Whether a server took the goal; false also when none answered.
    Answer(GoalId, bool),
    /// News of the goal.
    Feedback(GoalId, A::Feedback),
    /// The goal ended; no result when the server vanished.
    Ended(GoalId, GoalStatus, Option<A::Result>),
}

type DecodeGoal<I> = Box<dyn Fn(GoalId, &[u8]) -> Result<I, Refusal> + Send>;

/// How an offered action's events become inputs.
pub(super) struct ServerTable<I> {
    goal: DecodeGoal<I>,
    cancel: Box<dyn Fn(GoalId) -> I + Send>,
}

/// How a used action's events become inputs.
pub(super) struct ClientTable<I> {
    answer: Box<dyn Fn(GoalId, bool) -> I + Send>,
    feedback: DecodeGoal<I>,
    #[expect(clippy::type_complexity, reason = "one closure of a private table")]
    ended: Box<dyn Fn(GoalId, GoalStatus, Option<&[u8]>) -> Result<I, Refusal> + Send>,
}

impl<S> Wiring<S>
where
    S: Stage + Send + 'static,
    S::Input: Send + 'static,
    S::Output: Send + 'static,
{
    /// Offers an action.
    #[must_use]
    pub fn action_server<A: Action, I: IntoIterator<Item = GoalSignal<A>>>(
        mut self,
        action: &ActionName<A>,
        goal: impl Fn(GoalId, A::Goal) -> S::Input + Send + 'static,
        cancel: impl Fn(GoalId) -> S::Input + Send + 'static,
        signal: impl Fn(&S::Output) -> I + Send + 'static,
    ) -> Self {
        let server = self.ports.action_servers.len();
        let port = ActionPort {
            action: action.name.to_owned(),
            type_name: A::TYPE_NAME,
        };
        self.ports.action_servers.push(port);
        self.action_servers.push(ServerTable {
            goal: Box::new(move |id, bytes| Ok(goal(id, decode(bytes)?))),
            cancel: Box::new(cancel),
        });
        self.emitters.push(Box::new(move |output, out| {
            out.extend(signal(output).into_iter().map(|signal| match signal {
                GoalSignal::Accept(id) => Emission::AcceptGoal { server, id },
                GoalSignal::Reject(id) => Emission::RejectGoal { server, id },
                GoalSignal::Feedback(id, feedback) => Emission::Feedback {
                    server,
                    id,
                    bytes: encode(&feedback),
                },
                GoalSignal::Finish(id, status, result) => Emission::FinishGoal {
                    server,
                    id,
                    status,
                    bytes: encode(&GetResultResponse::<A> {
                        status: status as i8,
                        result,
                    }),
                },
            }));
        }));
        self
    }

    /// Uses an action of another node.
    #[must_use]
    pub fn action_client<A: Action>(
        mut self,
        action: &ActionName<A>,
        signal: impl Fn(&S::Output) -> Option<ClientSignal<A>> + Send + 'static,
        news: impl Fn(GoalNews<A>) -> S::Input + Send + Clone + 'static,
    ) -> Self {
        let client = self.ports.action_clients.len();
        let port = ActionPort {
            action: action.name.to_owned(),
            type_name: A::TYPE_NAME,
        };
        self.ports.action_clients.push(port);
        self.emitters.push(Box::new(move |output, out| {
            out.extend(signal(output).map(|signal| match signal {
                ClientSignal::Send(id, goal) => Emission::SendGoal {
                    client,
                    id,
                    bytes: encode(&goal),
                },
                ClientSignal::Cancel(id) => Emission::CancelGoal { client, id },
            }));
        }));
        let (answer, feedback) = (news.clone(), news.clone());
        self.action_clients.push(ClientTable {
            answer: Box::new(move |id, accepted| answer(GoalNews::Answer(id, accepted))),
            feedback: Box::new(move |id, bytes| {
                Ok(feedback(GoalNews::Feedback(id, decode(bytes)?)))
            }),
            ended: Box::new(move |id, status, bytes| {
                let response = bytes.map(decode::<GetResultResponse<A>>).transpose()?;
                let result = response.map(|response| response.result);
                Ok(news(GoalNews::Ended(id, status, result)))
            }),
        });
        self
    }
}

impl<S: Stage> Wiring<S> {
    /// Decoded input of an action's event; `None` for a port that does not exist.
    pub(super) fn action_input(&self, event: Event<'_>) -> Option<Result<S::Input, Refusal>> {
        match event {
            Event::Goal { server, id, bytes } => {
                Some((self.action_servers.get(server)?.goal)(id, bytes))
            }
            Event::Cancel { server, id } => Some(Ok((self.action_servers.get(server)?.cancel)(id))),
            Event::GoalAnswer {
                client,
                id,
                accepted,
            } => Some(Ok((self.action_clients.get(client)?.answer)(id, accepted))),
            Event::GoalFeedback { client, id, bytes } => {
                Some((self.action_clients.get(client)?.feedback)(id, bytes))
            }
            Event::GoalResult {
                client,
                id,
                status,
                bytes,
            } => Some((self.action_clients.get(client)?.ended)(id, status, bytes)),
            _ => None,
        }
    }
}
