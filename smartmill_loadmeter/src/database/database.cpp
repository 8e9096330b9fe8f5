#include "smartmill_loadmeter/database/database.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "fleet_server.h"
#include "record_fields.h"
#include "smartmill_core/error.h"
#include "smartmill_core/version.h"
#include "sqlite_store.h"

namespace smartmill::loadmeter {

namespace {

// Records carry the version of the software.
template <typename Record>
std::vector<Row> rowsOf(const std::string& file, const std::vector<Record>& records) {
  std::vector<Row> rows;
  for (Record record : records) {
    if (record.version.empty()) record.version = smartmill::version();
    try {
      rows.push_back(rowOf(record));
    } catch (const Error& error) {
      throw Error(withoutPassword(file) + ": " + error.what());
    }
  }
  return rows;
}

template <typename Record>
std::vector<Record> recordsOf(const std::vector<Row>& rows) {
  std::vector<Record> records(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) readRow(rows[i], &records[i]);
  return records;
}

std::size_t addRows(RecordStore& store, const std::string& file, const RecordKind& kind,
                    const std::vector<Row>& rows) {
  return naming(file, [&] { return store.add(kind, rows); });
}

std::vector<Row> allRows(RecordStore& store, const std::string& file, const RecordKind& kind) {
  return naming(file, [&] { return store.rows(kind); });
}

}  // namespace

struct CoefficientDatabase::Impl {
  std::string name;
  std::unique_ptr<RecordStore> store;
  SqliteStore* file = nullptr;  // the store; empty: a server

  explicit Impl(const std::string& path) : name(path.empty() ? ":memory:" : path) {
    if (isServerUrl(path)) {
      store = connectFleet(path);
    } else {
      auto opened = naming(name, [&] { return std::make_unique<SqliteStore>(name); });
      file = opened.get();
      store = std::move(opened);
    }
  }
};

CoefficientDatabase::CoefficientDatabase(const std::string& file) : impl_(std::make_unique<Impl>(file)) {
}
CoefficientDatabase::~CoefficientDatabase() = default;

bool CoefficientDatabase::add(const CoefficientRecord& record) {
  return add(std::vector<CoefficientRecord>{record}) == 1;
}

bool CoefficientDatabase::add(const CoefficientSet& set) {
  CoefficientRecord record;
  record.set = set;
  return add(record);
}

std::size_t CoefficientDatabase::add(const std::vector<CoefficientRecord>& records) {
  return addRows(*impl_->store, impl_->name, coefficientKind(), rowsOf(impl_->name, records));
}

std::optional<CoefficientSet> CoefficientDatabase::find(const std::string& tool,
                                                        const std::string& material) const {
  const auto newest = naming(impl_->name, [&] { return impl_->store->newest(tool, material); });
  return newest ? std::optional(newest->set) : std::nullopt;
}

std::vector<CoefficientRecord> CoefficientDatabase::records(const std::string& tool,
                                                            const std::string& material) const {
  return naming(impl_->name, [&] { return impl_->store->records(tool, material); });
}

std::vector<CoefficientRecord> CoefficientDatabase::near(const std::string& tool,
                                                         const CoefficientQuery& query) const {
  return naming(impl_->name, [&] { return impl_->store->near(tool, query); });
}

std::size_t CoefficientDatabase::size() const {
  return naming(impl_->name, [&] { return impl_->store->size(); });
}

std::size_t CoefficientDatabase::merge(const std::string& file) {
  std::FILE* there = std::fopen(file.c_str(), "rb");
  if (!there) throw Error(file + ": cannot be read");
  std::fclose(there);
  const CoefficientDatabase other(file);
  std::size_t added = 0;
  for (const RecordKind& kind : recordKinds())
    added += addRows(*impl_->store, impl_->name, kind, allRows(*other.impl_->store, file, kind));
  return added;
}

std::string CoefficientDatabase::contents() const {
  std::string text;
  for (const auto& [tool, material] : naming(impl_->name, [&] { return impl_->store->pairs(); }))
    text += (text.empty() ? "" : ", ") + tool + " / " + material;
  return text.empty() ? "no records" : text;
}

const std::string& CoefficientDatabase::file() const {
  return impl_->name;
}

void CoefficientDatabase::check() const {
  if (impl_->file) naming(impl_->name, [&] { impl_->file->check(); });
}

EvidenceRecords CoefficientDatabase::evidence() const {
  return {*impl_->store, impl_->name};
}

std::size_t EvidenceRecords::add(const std::vector<ModelImprovement>& improvements) const {
  return addRows(store_, file_, improvementKind(), rowsOf(file_, improvements));
}

std::size_t EvidenceRecords::add(const std::vector<HealthRecord>& health) const {
  return addRows(store_, file_, healthKind(), rowsOf(file_, health));
}

std::size_t EvidenceRecords::add(const std::vector<InspectionRecord>& inspections) const {
  return addRows(store_, file_, inspectionKind(), rowsOf(file_, inspections));
}

std::vector<ModelImprovement> EvidenceRecords::improvements() const {
  return recordsOf<ModelImprovement>(allRows(store_, file_, improvementKind()));
}

std::vector<HealthRecord> EvidenceRecords::health() const {
  return recordsOf<HealthRecord>(allRows(store_, file_, healthKind()));
}

std::vector<InspectionRecord> EvidenceRecords::inspections(const std::string& tool) const {
  std::vector<InspectionRecord> found = recordsOf<InspectionRecord>(allRows(store_, file_, inspectionKind()));
  if (!tool.empty())
    found.erase(
        std::remove_if(found.begin(), found.end(), [&](const InspectionRecord& r) { return r.tool != tool; }),
        found.end());
  return found;
}

FleetSynchronisation CoefficientDatabase::synchronisation() const {
  return {*impl_->file, impl_->name};
}

FleetSynchronisation::Batch FleetSynchronisation::unsent(const std::string& fleet, const RecordKind& kind,
                                                         std::size_t limit) const {
  return naming(file_, [&] { return store_.unsent(fleet, kind, limit); });
}

std::size_t FleetSynchronisation::unsentCount(const std::string& fleet) const {
  std::size_t count = 0;
  for (const RecordKind& kind : recordKinds())
    count += naming(file_, [&] { return store_.unsentCount(fleet, kind); });
  return count;
}

void FleetSynchronisation::markSent(const std::string& fleet, const RecordKind& kind,
                                    std::int64_t last) const {
  naming(file_, [&] { store_.markSent(fleet, kind, last); });
}

std::string FleetSynchronisation::lastFleet() const {
  return naming(file_, [&] { return store_.lastFleet(); });
}

std::size_t FleetSynchronisation::addFrom(const std::string& fleet, const RecordKind& kind,
                                          const std::vector<Row>& rows) const {
  return naming(file_, [&] { return store_.addFrom(fleet, kind, rows); });
}

std::vector<std::string> FleetSynchronisation::identities(const RecordKind& kind) const {
  return naming(file_, [&] { return store_.identities(kind); });
}

}  // namespace smartmill::loadmeter
