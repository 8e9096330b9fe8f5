#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_loadmeter/database/shop_records.h"

namespace smartmill::loadmeter {

/// Source of a record from a production cut.
constexpr const char* SOURCE_PRODUCTION = "production";

/// One identification. NaN and empty text: unknown.
struct CoefficientRecord {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  CoefficientSet set;                      ///< tool, material, source, stamp, values, standard deviations
  std::string machine;                     ///< name of the machine
  int teeth = 0;                           ///< 0: unknown
  double diameter = UNKNOWN;               ///< [m]
  double helix = UNKNOWN;                  ///< [rad]
  double rake = UNKNOWN;                   ///< [rad] normal rake
  double cutting_speed = UNKNOWN;          ///< [m/s]
  double feed_per_tooth = UNKNOWN;         ///< [m] mean of the cuts
  double axial_depth = UNKNOWN;            ///< [m] mean of the cuts
  double entry = UNKNOWN, exit = UNKNOWN;  ///< [rad]
  double edge_age = UNKNOWN;               ///< [s] cutting time of the edge
  double first_stamp = UNKNOWN;            ///< [s] of the first test used; independent records do not overlap
  double flank_wear = UNKNOWN;             ///< [m] width of flank wear land
  double temperature = UNKNOWN;            ///< [K] of the spindle during the tests
  std::string bag;                         ///< source bag or campaign
  std::string version;                     ///< of the software; set by add()
  /// Upper triangle of the covariance, row by row, in the order ktc, krc, kac, kte, kre, kae [SI]; NaN:
  /// unknown.
  std::array<double, 21> covariance = unknownCovariance();

  static std::array<double, 21> unknownCovariance() {
    std::array<double, 21> c{};
    c.fill(UNKNOWN);
    return c;
  }
  static std::size_t covarianceIndex(std::size_t row, std::size_t column);  ///< of 6 x 6, row <= column
};

/// Query of the database. NaN: not specified.
struct CoefficientQuery {
  std::string tool, material;                          ///< empty: any
  double cutting_speed = CoefficientRecord::UNKNOWN;   ///< [m/s]
  double feed_per_tooth = CoefficientRecord::UNKNOWN;  ///< [m]
  double diameter = CoefficientRecord::UNKNOWN;        ///< [m]
  double helix = CoefficientRecord::UNKNOWN;           ///< [rad]
  double rake = CoefficientRecord::UNKNOWN;            ///< [rad]
  double edge_age = CoefficientRecord::UNKNOWN;        ///< [s]
};

/// Growth of the uncertainty with the distance between a record and a query.
struct DistanceScale {
  double growth = 0.08;     ///< [1] > 0, relative standard deviation of a coefficient at distance 1
  double octaves = 1.0;     ///< [octave] > 0 of cutting speed, feed per tooth and diameter make distance 1
  double angle = 0.15;      ///< [rad] > 0, of rake or helix
  double age = 600.0;       ///< [s] > 0, of the edge's cutting time
  double other_tool = 2.0;  ///< [1] >= 0, any other tool in the same material
};

/// Distance between a record and a query; unknown and unspecified quantities are left out.
double distance(const CoefficientRecord& record, const CoefficientQuery& query, const DistanceScale& scale);

/// Answer to a query: the records combined, each with its covariance widened by its distance.
struct CoefficientEstimate {
  CoefficientSet set;       ///< tool and material of the nearest record
  double nearest = 0.0;     ///< [1] distance of the nearest record
  int records = 0;          ///< combined
  bool other_tool = false;  ///< no record has the requested tool
};

struct RecordKind;
struct Row;
class RecordStore;
class SqliteStore;

/// Model improvements, spindle health and measured dimensions of parts next to the coefficients. A view of
/// the database.
class EvidenceRecords {
 public:
  EvidenceRecords(RecordStore& store, const std::string& file) : store_(store), file_(file) {}

  /// @{ One transaction. @return number of new records. @throws Error when they cannot be written.
  std::size_t add(const std::vector<ModelImprovement>& improvements) const;
  std::size_t add(const std::vector<HealthRecord>& health) const;
  std::size_t add(const std::vector<InspectionRecord>& inspections) const;
  /// @}
  std::vector<ModelImprovement> improvements() const;  ///< oldest first
  std::vector<HealthRecord> health() const;            ///< oldest first
  /// Oldest first. @param tool empty: any
  std::vector<InspectionRecord> inspections(const std::string& tool = "") const;

 private:
  RecordStore& store_;
  const std::string& file_;  // for messages
};

/// Synchronisation of a machine's file with fleets, each of which is named by its identity. Records of each
/// kind are numbered in the order of insertion. A view of the database.
class FleetSynchronisation {
 public:
  struct Batch {
    std::vector<Row> rows;
    std::int64_t last = 0;  ///< number of the last row
  };
  FleetSynchronisation(SqliteStore& store, const std::string& file) : store_(store), file_(file) {}

  Batch unsent(const std::string& fleet, const RecordKind& kind, std::size_t limit) const;  ///< oldest first
  std::size_t unsentCount(const std::string& fleet) const;                                  ///< of all kinds
  /// Records not sent to the fleet that was pushed to last.
  std::size_t behind() const { return unsentCount(lastFleet()); }
  /// Marks all rows up to this number.
  void markSent(const std::string& fleet, const RecordKind& kind, std::int64_t last) const;
  /// Identity of the fleet that was pushed to last; empty: none.
  std::string lastFleet() const;
  /// Adds records of the fleet, which are not sent back. @return number of new records.
  std::size_t addFrom(const std::string& fleet, const RecordKind& kind, const std::vector<Row>& rows) const;
  std::vector<std::string> identities(const RecordKind& kind) const;

 private:
  SqliteStore& store_;
  const std::string& file_;  // for messages
};

/// Coefficients, model improvements, spindle health and measured dimensions of a machine's parts in one
/// SQLite file or in memory. Each add() is one durable transaction (write-ahead log, synchronous): it
/// survives a crash after it has returned, and several processes may write concurrently. A record with the
/// content of an existing one is ignored. With the address of a fleet's server (fleet.h) instead of a file,
/// the queries go to the server.
class CoefficientDatabase {
 public:
  /// @param file empty: in memory; postgresql://..: a fleet's server. @throws Error when the file is not such
  /// a database or cannot be opened.
  explicit CoefficientDatabase(const std::string& file);
  ~CoefficientDatabase();
  CoefficientDatabase(const CoefficientDatabase&) = delete;
  CoefficientDatabase& operator=(const CoefficientDatabase&) = delete;

  /// @return false when the record exists already. @throws Error when it cannot be written.
  bool add(const CoefficientRecord& record);
  bool add(const CoefficientSet& set);
  /// One transaction. @return number of new records.
  std::size_t add(const std::vector<CoefficientRecord>& records);

  /// Newest set of this tool and material; empty text matches any.
  std::optional<CoefficientSet> find(const std::string& tool, const std::string& material) const;

  /// Best estimate for a query, from the newest records near the cutting speed of the tool, or of other tools
  /// in the material if there are none. Empty: no record in this material.
  std::optional<CoefficientEstimate> estimate(const CoefficientQuery& query,
                                              const DistanceScale& scale = DistanceScale()) const;

  /// Oldest first. Empty text matches any.
  std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) const;
  std::size_t size() const;

  /// Copies the records of another machine's file. @return number of new records.
  std::size_t merge(const std::string& file);

  /// "tool / material" of all records, for messages.
  std::string contents() const;

  const std::string& file() const;
  /// @throws Error when the content of the file is damaged.
  void check() const;

  EvidenceRecords evidence() const;
  /// Of a file; not of a server.
  FleetSynchronisation synchronisation() const;

 private:
  std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// @{ Records as CSV (one header row, name[unit]) or YAML (smartmill-coefficients/1) with 17 digits, so that
/// export and import are lossless. @throws Error with file, line or key, and value.
void exportCsv(const std::vector<CoefficientRecord>& records, const std::string& file);
std::vector<CoefficientRecord> importCsv(const std::string& file);
void exportYaml(const std::vector<CoefficientRecord>& records, const std::string& file);
std::vector<CoefficientRecord> importYaml(const std::string& file);
/// @}

}  // namespace smartmill::loadmeter
