#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/LU>

#include "smartmill_stability/solvers/delayed_system.h"
#include "solvers/arnoldi.h"
#include "solvers/element_response.h"

namespace smartmill::stability {

/// The map over one period of [state; motion at the nodes that is needed with a delay in the next period].
class PeriodMap {
 public:
  PeriodMap(const DelayedSystem& system, ResponseCache& responses);
  Dominant dominant(bool with_vector);
  /// [Hz] Strongest Fourier component of the motion of an eigenvector. @param highest [rad/s]
  double strongest(const Dominant& mode, double highest);

 private:
  /// Source of the delayed motion at a node.
  struct Source {
    std::size_t element = 0;
    bool previous = true;     ///< in the previous period
    Eigen::VectorXd weights;  ///< of the nodes of that element; empty: the same node
  };

  struct Element {
    double begin = 0.0, length = 0.0;
    std::shared_ptr<const ElementResponse> response;
    bool cuts = false, needed = false, needed_next_period = false;
    Eigen::Index slot = 0;
    /// If the delay is the period: [state at the end; motion at the nodes] from [state; motion one period
    /// ago]. Otherwise empty, and the members below are used.
    Eigen::MatrixXd step;
    Eigen::MatrixXd from_state;                         // (n D) x 2M
    Eigen::PartialPivLU<Eigen::MatrixXd> lu;            // of I - feedback x response
    std::vector<std::vector<Eigen::MatrixXd>> delayed;  // [delay][node] D x D, empty where zero
    std::vector<std::vector<Source>> source;            // [delay][node]; one entry: the whole element
  };

  void mesh(const DelayedSystem& system);
  Source find(double t, std::size_t self);
  void fill(const DelayedSystem& system, ResponseCache& responses, Element& element);
  void condense(Element& element);
  void march(const Eigen::VectorXd& in, Eigen::VectorXd& out, bool everywhere);

  Eigen::Index d_, n_, m2_, size_ = 0;
  const ReferenceElement& reference_;
  double period_;
  ResponseCache& responses_;
  std::vector<Element> elements_;
  std::vector<Eigen::VectorXd> motion_;
  Eigen::VectorXd state_, next_, force_, before_, after_;
  double delayed_[2] = {0.0, 0.0};
};

}  // namespace smartmill::stability
