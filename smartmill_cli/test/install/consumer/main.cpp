#include <cstdio>

#include <smartmill_core/modal/modal_model.h>
#include <smartmill_stability/chart/cut_request.h>

int main() {
  smartmill::ModalModel tip;
  tip.modes.push_back({800.0, 0.03, 1.0e-7});
  tip.direct = 2.0e-8;
  std::printf("%.3e m/N\n", tip.staticGain());
}
