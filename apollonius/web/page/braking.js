// Whether a robot can still stop in time: what the package's shield asks before each action.

import { handArena, handRobot } from "./handing.js";
import { given, run } from "./programs.js";
import { gears } from "./rules.js";

const MARGIN = 1e-3; // room [m] that the shield wants

/** Least clearance [m] during an action and the best of three ways to brake to rest after it; less where it is ample. */
export function roomAfter({ arena, dt }, body, robot, action) {
  handArena(arena);
  handRobot(body, robot);
  given.gears().set(gears(action));
  return run.room_after(dt)[0];
}

/** Whether that is as much as the shield wants. */
export const leavesRoom = (...asked) => roomAfter(...asked) > MARGIN;
