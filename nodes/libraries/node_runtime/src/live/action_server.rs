//! The server's side of an action: three services and two topics, as `rcl_action` speaks them.
//!
//! Goals, feedback and results pass through serialised. A goal's 16-byte identifier stands in front
//! of goal and feedback and keeps their alignment, so that it is taken off and put on without a look
//! at the types; a result is preceded by one byte, which does not, and therefore the node serialises
//! the whole response of `get_result`.

use std::collections::BTreeMap;
use std::time::Duration;

use abbe_msgs::action_msgs::msg::{GoalInfo, GoalStatus as StatusMessage, GoalStatusArray};
use abbe_msgs::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::unique_identifier_msgs::msg::UUID;
use abbe_msgs::{ENCAPSULATION, to_cdr};
use tokio::time::Instant;

use super::service::{ReplyTo, put_front, shared, take_front};
use crate::node::{Bytes, GoalId, GoalStatus};

/// Name of a goal on the wire.
pub(super) type Uuid = [u8; 16];

/// How long a result is kept for those who ask late, as `rcl_action` did before Jazzy.
const RESULT_KEPT: Duration = Duration::from_secs(900);

/// A run of zeros is the default value of every type that fits into it: the result of no goal.
const EMPTY_RESULT_LEN: usize = 1_024;

/// One of the three services of an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GoalService {
    SendGoal,
    CancelGoal,
    GetResult,
}

/// An answer to send.
#[derive(Debug, PartialEq)]
pub(super) struct Answer {
    pub service: GoalService,
    pub to: ReplyTo,
    pub bytes: Bytes,
}

struct Goal {
    uuid: Uuid,
    accepted: Time,
    status: i8,
    asked_for_result: Vec<ReplyTo>,
    result: Option<(Bytes, Instant)>,
}

impl Goal {
    const fn has_ended(&self) -> bool {
        self.result.is_some()
    }

    fn info(&self) -> GoalInfo {
        GoalInfo {
            goal_id: UUID { uuid: self.uuid },
            stamp: self.accepted.clone(),
        }
    }
}

/// Requests for the result of one goal that wait for its end; of more the oldest stays without an answer.
const MOST_ASKING: usize = 1_024;

/// All goals of one action.
#[derive(Default)]
pub(super) struct ActionServer {
    next_id: GoalId,
    proposed: BTreeMap<GoalId, (Uuid, ReplyTo)>,
    goals: BTreeMap<GoalId, Goal>,
}

fn goal_answer(to: ReplyTo, accepted: bool, at: &Time) -> Answer {
    let mut bytes = ENCAPSULATION.to_vec();
    bytes.extend([u8::from(accepted), 0, 0, 0]);
    bytes.extend(at.sec.to_le_bytes());
    bytes.extend(at.nanosec.to_le_bytes());
    Answer {
        service: GoalService::SendGoal,
        to,
        bytes: shared(&bytes),
    }
}

fn result_answer(to: ReplyTo, bytes: &Bytes) -> Answer {
    Answer {
        service: GoalService::GetResult,
        to,
        bytes: Bytes::clone(bytes),
    }
}

impl ActionServer {
    /// A goal is proposed. The node's number for it and its bytes, or the answer when there can be none.
    pub fn propose(
        &mut self,
        to: ReplyTo,
        bytes: &[u8],
    ) -> Result<(GoalId, Bytes), Option<Answer>> {
        let Some((uuid, goal)) = take_front::<16>(bytes) else {
            return Err(None);
        };
        let is_known = self.goals.values().any(|goal| goal.uuid == uuid)
            || self.proposed.values().any(|(other, _)| *other == uuid);
        if is_known {
            return Err(Some(goal_answer(to, false, &Time::default())));
        }
        self.next_id += 1;
        self.proposed.insert(self.next_id, (uuid, to));
        Ok((self.next_id, goal))
    }

    /// The node takes or refuses a goal.
    pub fn decide(&mut self, id: GoalId, accepted: bool, at: Time) -> Option<Answer> {
        let (uuid, to) = self.proposed.remove(&id)?;
        if accepted {
            let goal = Goal {
                uuid,
                accepted: at.clone(),
                status: StatusMessage::STATUS_EXECUTING,
                asked_for_result: Vec::new(),
                result: None,
            };
            self.goals.insert(id, goal);
        }
        Some(goal_answer(to, accepted, &at))
    }

    /// Feedback with its goal in front.
    pub fn feedback(&self, id: GoalId, bytes: &[u8]) -> Option<Bytes> {
        let goal = self.goals.get(&id).filter(|goal| !goal.has_ended())?;
        Some(put_front(&goal.uuid, bytes))
    }

    /// A goal has ended; the results that were asked for.
    pub fn finish(
        &mut self,
        id: GoalId,
        status: GoalStatus,
        bytes: &Bytes,
        now: Instant,
    ) -> Vec<Answer> {
        let Some(goal) = self.goals.get_mut(&id).filter(|goal| !goal.has_ended()) else {
            return Vec::new();
        };
        goal.status = status as i8;
        goal.result = Some((Bytes::clone(bytes), now + RESULT_KEPT));
        goal.asked_for_result
            .drain(..)
            .map(|to| result_answer(to, bytes))
            .collect()
    }

    /// Somebody asks for a result.
    pub fn result(&mut self, to: ReplyTo, bytes: &[u8]) -> Option<Answer> {
        let (uuid, _) = take_front::<16>(bytes)?;
        match self.goals.values_mut().find(|goal| goal.uuid == uuid) {
            Some(Goal {
                result: Some((bytes, _)),
                ..
            }) => Some(result_answer(to, bytes)),
            Some(goal) => {
                if goal.asked_for_result.len() >= MOST_ASKING {
                    goal.asked_for_result.remove(0);
                }
                goal.asked_for_result.push(to);
                None
            }
            None => {
                let mut bytes = ENCAPSULATION.to_vec();
                bytes.resize(ENCAPSULATION.len() + EMPTY_RESULT_LEN, 0);
                Some(result_answer(to, &shared(&bytes)))
            }
        }
    }

    /// Somebody calls goals off: those to be told to the node, and the answer.
    pub fn cancel(&mut self, to: ReplyTo, request: &CancelGoalRequest) -> (Vec<GoalId>, Answer) {
        let GoalInfo { goal_id, stamp } = &request.goal_info;
        // Seconds are unsigned here as everywhere: a goal of 2040 comes after one of 2030.
        let ordered = |time: &Time| (time.sec.cast_unsigned(), time.nanosec);
        let before = ordered(stamp);
        let (any_id, any_time) = (goal_id.uuid == [0; 16], before == (0, 0));
        let mut response = CancelGoalResponse::default();
        let mut cancelled = Vec::new();
        let mut found = None;
        for (id, goal) in &mut self.goals {
            let is_named = goal.uuid == goal_id.uuid;
            let is_before = ordered(&goal.accepted) <= before;
            let is_meant = is_named || if any_time { any_id } else { is_before };
            if !is_meant {
                continue;
            }
            if is_named {
                found = Some(goal.has_ended());
            }
            if !goal.has_ended() {
                response.goals_canceling.push(goal.info());
                if goal.status != StatusMessage::STATUS_CANCELING {
                    goal.status = StatusMessage::STATUS_CANCELING;
                    cancelled.push(*id);
                }
            }
        }
        response.return_code = match (response.goals_canceling.is_empty(), any_id, found) {
            (true, false, None) => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
            (true, false, Some(true)) => CancelGoalResponse::ERROR_GOAL_TERMINATED,
            _ => CancelGoalResponse::ERROR_NONE,
        };
        let bytes = shared(&to_cdr(&response));
        (
            cancelled,
            Answer {
                service: GoalService::CancelGoal,
                to,
                bytes,
            },
        )
    }

    /// Forgets results that nobody fetched in time; whether there were any.
    pub fn forget(&mut self, now: Instant) -> bool {
        let before = self.goals.len();
        self.goals
            .retain(|_, goal| goal.result.as_ref().is_none_or(|(_, until)| *until > now));
        self.goals.len() != before
    }

    /// The message for the status topic.
    pub fn status(&self) -> Bytes {
        let status_list = self
            .goals
            .values()
            .map(|goal| StatusMessage {
                goal_info: goal.info(),
                status: goal.status,
            })
            .collect();
        shared(&to_cdr(&GoalStatusArray { status_list }))
    }
}

#[cfg(test)]
mod tests {
    use abbe_msgs::from_cdr;

    use super::*;
    use crate::network::RequestIdentity;

    fn to(sequence: i64) -> ReplyTo {
        ReplyTo::Related(RequestIdentity {
            writer: [1; 16],
            sequence,
        })
    }

    fn goal(uuid: u8) -> Vec<u8> {
        let mut bytes = ENCAPSULATION.to_vec();
        bytes.extend([uuid; 16]);
        bytes.extend([5, 6, 7, 8]);
        bytes
    }

    fn request(uuid: u8) -> CancelGoalRequest {
        let goal_id = UUID { uuid: [uuid; 16] };
        CancelGoalRequest {
            goal_info: GoalInfo {
                goal_id,
                stamp: Time::default(),
            },
        }
    }

    #[test]
    fn a_goal_runs_and_its_result_reaches_early_and_late_askers() {
        let now = Instant::now();
        let mut server = ActionServer::default();
        let (id, bytes) = server.propose(to(1), &goal(9)).unwrap();
        assert_eq!(&bytes[4..], [5, 6, 7, 8]);
        let answer = server
            .decide(id, true, Time { sec: 3, nanosec: 4 })
            .unwrap();
        assert_eq!(&answer.bytes[4..], [1, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0]);
        assert_eq!(server.result(to(2), &goal(9)), None, "not yet");
        let feedback = server.feedback(id, &[0, 1, 0, 0, 77]).unwrap();
        assert_eq!(feedback[4..20], [9; 16]);
        let result: Bytes = shared(&[0, 1, 0, 0, 4, 1]);
        let answers = server.finish(id, GoalStatus::Succeeded, &result, now);
        assert_eq!(answers, [result_answer(to(2), &result)]);
        assert_eq!(
            server.result(to(3), &goal(9)),
            Some(result_answer(to(3), &result))
        );
        assert_eq!(server.feedback(id, &[0, 1, 0, 0]), None, "after the end");
        assert!(server.forget(now + RESULT_KEPT));
        let unknown = server.result(to(4), &goal(9)).unwrap();
        assert_eq!(unknown.bytes[4], 0, "status unknown");
    }

    #[test]
    fn the_same_goal_twice_is_refused() {
        let mut server = ActionServer::default();
        server.propose(to(1), &goal(9)).unwrap();
        let answer = server.propose(to(2), &goal(9)).unwrap_err().unwrap();
        assert_eq!((answer.to, answer.bytes[4]), (to(2), 0));
        assert_eq!(
            server.propose(to(3), &[0, 1, 0, 0, 1]).unwrap_err(),
            None,
            "too short"
        );
    }

    #[test]
    fn cancelling_follows_the_policy_of_ros() {
        let mut server = ActionServer::default();
        let codes = |answer: Answer| {
            let response: CancelGoalResponse = from_cdr(&answer.bytes).unwrap();
            (response.return_code, response.goals_canceling.len())
        };
        for (uuid, sec) in [(1, 10), (2, 20), (3, 30)] {
            let (id, _) = server.propose(to(1), &goal(uuid)).unwrap();
            server.decide(id, true, Time { sec, nanosec: 0 }).unwrap();
        }
        let (told, answer) = server.cancel(to(2), &request(2));
        assert_eq!((told, codes(answer)), (vec![2], (0, 1)));
        let (told, answer) = server.cancel(to(2), &request(2));
        assert_eq!((told, codes(answer)), (vec![], (0, 1)), "told only once");
        assert_eq!(
            codes(server.cancel(to(2), &request(8)).1),
            (2, 0),
            "unknown goal"
        );
        server.finish(
            2,
            GoalStatus::Canceled,
            &shared(&[0, 1, 0, 0]),
            Instant::now(),
        );
        assert_eq!(
            codes(server.cancel(to(2), &request(2)).1),
            (3, 0),
            "already ended"
        );
        let mut early = request(0);
        early.goal_info.stamp = Time {
            sec: 15,
            nanosec: 0,
        };
        assert_eq!(server.cancel(to(2), &early).0, [1]);
        assert_eq!(
            server.cancel(to(2), &request(0)).0,
            [3],
            "all that are left"
        );
    }
}
