// Ktc and Kte from load-meter records of a campaign: campaign_identification.h.
#include "load_estimator.h"

namespace smartmill::loadmeter {

LoadRecordResult identifyFromLoadRecords(const Campaign& campaign, const MachineModel& model,
                                         const LoadRecordOptions& options) {
  std::vector<TestRecord> tests;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind == TestKind::cut || test.kind == TestKind::air)
      tests.push_back({test, inFeedAxes(readRecord(campaign, test), test)});
  }
  return identifyFromLoadRecords(tests, model, options, campaign.folder);
}

LoadRecordResult identifyFromLoadRecords(const std::vector<TestRecord>& tests, const MachineModel& model,
                                         const LoadRecordOptions& options, const std::string& where) {
  const Spindle& spindle = model.needSpindle("read the load meter");
  const ToolGeometry& tool = model.needTool("identify cutting coefficients");
  std::vector<LoadRecord> records;
  std::vector<std::string> notes;
  bool timed = true;
  for (const auto& [test, record] : tests) {
    timed = timed && test.start_time;
    if (record.has("load_meter")) {
      records.push_back(loadRecord(test, record, tool));
    } else {
      notes.push_back(record.file + ": no column load_meter, ignored");
    }
  }
  LoadEstimator estimator(std::move(records), spindle, model.uncertainty.spindle, options, 0.0, timed, where);
  LoadRecordResult result = estimator.estimate();
  result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
  return result;
}

}  // namespace smartmill::loadmeter
