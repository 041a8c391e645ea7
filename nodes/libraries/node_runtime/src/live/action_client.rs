//! The client's side of an action.

use std::collections::BTreeMap;

use abbe_msgs::action_msgs::msg::{GoalInfo, GoalStatus as StatusMessage};
use abbe_msgs::action_msgs::srv::CancelGoalRequest;
use abbe_msgs::unique_identifier_msgs::msg::UUID;
use abbe_msgs::{ENCAPSULATION, to_cdr};

use super::action_server::{GoalService, Uuid};
use super::service::{put_front, shared, take_front};
use crate::node::{Bytes, GoalId, GoalStatus};

/// Our goals at one action. The requests' tokens are the goals' numbers.
#[derive(Default)]
pub(super) struct ActionClient {
    goals: BTreeMap<GoalId, Uuid>,
}

/// What to ask of the server.
#[derive(Debug, PartialEq)]
pub(super) struct Ask {
    pub service: GoalService,
    pub token: u64,
    pub bytes: Bytes,
}

/// What the node is told.
#[derive(Debug, PartialEq)]
pub(super) enum News {
    Answer {
        id: GoalId,
        accepted: bool,
    },
    Result {
        id: GoalId,
        status: GoalStatus,
        bytes: Option<Bytes>,
    },
}

const ENCAPSULATION_LEN: usize = ENCAPSULATION.len();

impl ActionClient {
    pub fn send(&mut self, id: GoalId, uuid: Uuid, goal: &[u8]) -> Ask {
        self.goals.insert(id, uuid);
        Ask {
            service: GoalService::SendGoal,
            token: id,
            bytes: put_front(&uuid, goal),
        }
    }

    pub fn cancel(&self, id: GoalId) -> Option<Ask> {
        let goal_id = UUID {
            uuid: *self.goals.get(&id)?,
        };
        let goal_info = GoalInfo {
            goal_id,
            ..GoalInfo::default()
        };
        let bytes = shared(&to_cdr(&CancelGoalRequest { goal_info }));
        Some(Ask {
            service: GoalService::CancelGoal,
            token: id,
            bytes,
        })
    }

    /// A reply came, or (`None`) none will.
    pub fn replied(
        &mut self,
        service: GoalService,
        id: GoalId,
        bytes: Option<&Bytes>,
    ) -> (Option<News>, Option<Ask>) {
        let Some(uuid) = self.goals.get(&id).copied() else {
            return (None, None);
        };
        match service {
            GoalService::CancelGoal => (None, None),
            GoalService::SendGoal => {
                let accepted = bytes.and_then(|bytes| bytes.get(ENCAPSULATION_LEN)) == Some(&1);
                let ask = if accepted {
                    let bytes = put_front(&uuid, &ENCAPSULATION);
                    Some(Ask {
                        service: GoalService::GetResult,
                        token: id,
                        bytes,
                    })
                } else {
                    self.goals.remove(&id);
                    None
                };
                (Some(News::Answer { id, accepted }), ask)
            }
            GoalService::GetResult => {
                self.goals.remove(&id);
                let status = bytes
                    .and_then(|bytes| bytes.get(ENCAPSULATION_LEN))
                    .map(|byte| *byte as i8);
                let news = match status {
                    Some(StatusMessage::STATUS_SUCCEEDED) => (GoalStatus::Succeeded, bytes),
                    Some(StatusMessage::STATUS_CANCELED) => (GoalStatus::Canceled, bytes),
                    Some(StatusMessage::STATUS_ABORTED) => (GoalStatus::Aborted, bytes),
                    // The server does not know the goal: it was started anew.
                    _ => (GoalStatus::Aborted, None),
                };
                (
                    Some(News::Result {
                        id,
                        status: news.0,
                        bytes: news.1.cloned(),
                    }),
                    None,
                )
            }
        }
    }

    /// The goal that feedback is of, and the feedback itself.
    pub fn feedback(&self, bytes: &[u8]) -> Option<(GoalId, Bytes)> {
        let (uuid, feedback) = take_front::<16>(bytes)?;
        let (id, _) = self.goals.iter().find(|(_, goal)| **goal == uuid)?;
        Some((*id, feedback))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_goal_is_sent_accepted_and_brought_to_its_end() {
        let mut client = ActionClient::default();
        let ask = client.send(5, [9; 16], &[0, 1, 0, 0, 42]);
        assert_eq!(&ask.bytes[20..], [42]);
        let accepted = shared(&[0, 1, 0, 0, 1, 0, 0, 0]);
        let (news, ask) = client.replied(GoalService::SendGoal, 5, Some(&accepted));
        assert_eq!(
            news,
            Some(News::Answer {
                id: 5,
                accepted: true
            })
        );
        assert_eq!(ask.unwrap().service, GoalService::GetResult);
        let feedback = put_front(&[9; 16], &[0, 1, 0, 0, 7]);
        assert_eq!(client.feedback(&feedback).unwrap().0, 5);
        assert!(client.cancel(5).is_some());
        let result = shared(&[0, 1, 0, 0, 4, 1]);
        let (news, _) = client.replied(GoalService::GetResult, 5, Some(&result));
        let status = GoalStatus::Succeeded;
        assert_eq!(
            news,
            Some(News::Result {
                id: 5,
                status,
                bytes: Some(result)
            })
        );
        assert!(client.feedback(&feedback).is_none(), "after the end");
    }

    #[test]
    fn silence_and_strangers_end_a_goal() {
        let mut client = ActionClient::default();
        client.send(1, [1; 16], &ENCAPSULATION);
        let (news, ask) = client.replied(GoalService::SendGoal, 1, None);
        assert_eq!(
            (news, ask),
            (
                Some(News::Answer {
                    id: 1,
                    accepted: false
                }),
                None
            )
        );
        client.send(2, [2; 16], &ENCAPSULATION);
        let unknown = shared(&[0, 1, 0, 0, 0]);
        let (news, _) = client.replied(GoalService::GetResult, 2, Some(&unknown));
        let aborted = News::Result {
            id: 2,
            status: GoalStatus::Aborted,
            bytes: None,
        };
        assert_eq!(news, Some(aborted));
    }
}
