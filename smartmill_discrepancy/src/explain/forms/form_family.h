#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/results/finding.h"

namespace smartmill::discrepancy {

/// Residual of one channel of one test.
struct ChannelResidual {
  const TestData* test = nullptr;
  std::vector<double> values;  ///< over the noise, about their mean
  double mean = 0.0;
  double noise = 1.0;  ///< [unit of the channel]
};

/// The residual in which forms are located.
struct FormContext {
  const TwinRunner& runner;
  const std::vector<Hypothesis>& forms;  ///< of the campaign, including those without probes
  const FitResult& now;                  ///< fit whose residual is used
  const std::vector<Finding>& unexplained;
  std::map<std::string, std::vector<ChannelResidual>> channels;
};

/// One family of empirical forms whose place follows from the residual. A new one is a class, a factory below
/// and its position in residual_localisation.cpp.
class FormFamily {
 public:
  virtual ~FormFamily() = default;
  /// Adds located forms.
  virtual void locate(const FormContext& context, std::vector<Hypothesis>* located) const = 0;
};

std::unique_ptr<FormFamily> makeLines();
std::unique_ptr<FormFamily> makeSteps();
std::unique_ptr<FormFamily> makeBursts();
std::unique_ptr<FormFamily> makeResonances();
std::unique_ptr<FormFamily> makeForceCourses();

/// Whether a hypothesis is a form of the empirical catalogue whose variant begins as stated.
bool isForm(const Hypothesis& hypothesis, const char* form, const std::string& variant);

}  // namespace smartmill::discrepancy
