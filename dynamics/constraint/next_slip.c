/// How far the point of a contact has moved over the step (METHOD.md, 13). The tangential rows of the paper compare J v_next
/// at q; where links turn, a point that does not move at q has moved after the step by h^2/2 times its acceleration: 7.6 cm/s
/// under a stick of 0.3 m that turns about its foot at 10 rad/s, h = 10 ms. Here the point of either body goes with it to
/// q (+) h v_next, and the rows see the way between the two over h, as the first body sees it, so that nothing slides
/// where both move as one.
#include "constraint.h"
#include "math3.h"

// where a point of a link at q is after the step, and the rotation between
static void carry(const cav_state *state, int link, const double point[3], double after[3], double turn[9]) {
  const cav_pose *from = &state->link[link], *to = &state->work->next->link[link];
  double arm[3], local[3];
  sub3(arm, point, from->pos);
  rotate_back(local, from->rotation, arm);
  transform(after, to->pos, to->rotation, local);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) turn[3 * i + j] = dot3(to->rotation + 3 * i, from->rotation + 3 * j);
}

void cav_next_slip_find(const cav_state *state, const cav_contact *c, cav_next_contact *out) {
  double first[3], by_first[9], by_second[9], between[3];
  carry(state, c->link1, c->pos, first, by_first);
  carry(state, c->link2, c->pos, out->after, by_second);
  sub3(between, out->after, first);
  rotate_back(out->way, by_first, between);
  for (int i = 0; i < 2; i++) rotate(out->tangent[i], by_first, c->frame + 3 * (1 + i));
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      out->turn[3 * i + j] = 0;
      for (int k = 0; k < 3; k++) out->turn[3 * i + j] += by_first[3 * k + i] * by_second[3 * k + j];
    }
}
