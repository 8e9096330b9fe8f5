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

/// Source of a record that a cut of production has left.
constexpr const char* SOURCE_PRODUCTION = "production";

/// One identification as this machine keeps it. NaN (and an empty word): not known.
struct CoefficientRecord {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  CoefficientSet set;                      ///< tool, material, source, stamp, values, standard deviations
  std::string machine;                     ///< name of the machine
  int teeth = 0;                           ///< 0: not known
  double diameter = UNKNOWN;               ///< [m]
  double helix = UNKNOWN;                  ///< [rad]
  double rake = UNKNOWN;                   ///< [rad] normal rake
  double cutting_speed = UNKNOWN;          ///< [m/s]
  double feed_per_tooth = UNKNOWN;         ///< [m] mean of the cuts
  double axial_depth = UNKNOWN;            ///< [m] mean of the cuts
  double entry = UNKNOWN, exit = UNKNOWN;  ///< [rad]
  double edge_age = UNKNOWN;               ///< [s] cutting time of the edge
  std::string bag;                         ///< bag or campaign it came from
  std::string version;                     ///< of the software; filled in by add()
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

/// What is asked of the database. NaN: no matter.
struct CoefficientQuery {
  std::string tool, material;                          ///< empty: any
  double cutting_speed = CoefficientRecord::UNKNOWN;   ///< [m/s]
  double feed_per_tooth = CoefficientRecord::UNKNOWN;  ///< [m]
  double diameter = CoefficientRecord::UNKNOWN;        ///< [m]
  double helix = CoefficientRecord::UNKNOWN;           ///< [rad]
  double rake = CoefficientRecord::UNKNOWN;            ///< [rad]
  double edge_age = CoefficientRecord::UNKNOWN;        ///< [s]
};

/// How fast knowledge fades with distance from what was tried.
struct DistanceScale {
  double growth = 0.08;     ///< [1] > 0, relative standard deviation of a coefficient at distance 1
  double octaves = 1.0;     ///< [octave] > 0 of cutting speed, feed per tooth and diameter make distance 1
  double angle = 0.15;      ///< [rad] > 0, of rake or helix
  double age = 600.0;       ///< [s] > 0, of the edge's cutting time
  double other_tool = 2.0;  ///< [1] >= 0, another tool of whatever name in the same material
};

/// Distance between what was tried and what is asked, unknown or unasked quantities left out.
double distance(const CoefficientRecord& record, const CoefficientQuery& query, const DistanceScale& scale);

/// Answer to a query: records combined, each with its own covariance widened by its distance.
struct CoefficientEstimate {
  CoefficientSet set;       ///< tool and material of the nearest record
  double nearest = 0.0;     ///< [1] distance of the nearest record
  int records = 0;          ///< combined
  bool other_tool = false;  ///< nothing was tried with the asked tool
};

struct RecordKind;
struct Row;

/// Everything a machine has identified, what its model was found to lack, and its spindle's health: one
/// SQLite file a machine, or in memory. Each add() is one durable
/// transaction (write-ahead log, synchronised): when it has returned, no crash takes it back, and any number
/// of processes may write at once. A record with the content of one that is there is kept once. The same
/// questions go to a fleet's server (fleet.h), where its address stands in the file's place.
class CoefficientDatabase {
 public:
  /// @param file empty: in memory; postgresql://..: a fleet's server. @throws Error naming a file that is no
  /// such database or cannot be opened.
  explicit CoefficientDatabase(const std::string& file);
  ~CoefficientDatabase();
  CoefficientDatabase(const CoefficientDatabase&) = delete;
  CoefficientDatabase& operator=(const CoefficientDatabase&) = delete;

  /// @return false when it is there already. @throws Error when it cannot be written.
  bool add(const CoefficientRecord& record);
  bool add(const CoefficientSet& set);
  /// @{ One transaction: all or none. @return how many were new.
  std::size_t add(const std::vector<CoefficientRecord>& records);
  std::size_t add(const std::vector<ModelImprovement>& improvements);
  std::size_t add(const std::vector<HealthRecord>& health);
  /// @}

  /// The newest of this tool and material; empty words match any.
  std::optional<CoefficientSet> find(const std::string& tool, const std::string& material) const;

  /// Best knowledge for a query: newest records near the asked speed, of the tool, else of other tools in the
  /// material. Empty: nothing in this material.
  std::optional<CoefficientEstimate> estimate(const CoefficientQuery& query,
                                              const DistanceScale& scale = DistanceScale()) const;

  /// Oldest first. Empty words match any.
  std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) const;
  std::size_t size() const;
  std::vector<ModelImprovement> improvements() const;  ///< oldest first
  std::vector<HealthRecord> health() const;            ///< oldest first

  /// Takes over what another machine's file has. @return how many were new.
  std::size_t merge(const std::string& file);

  /// "tool / material" of what is known, for messages.
  std::string contents() const;

  const std::string& file() const;

  /// @{ Of a file, for a fleet (by its identity) to which it is handed on. Records are numbered as they come,
  /// each kind by itself.
  struct Batch {
    std::vector<Row> rows;
    std::int64_t last = 0;  ///< number of the last one
  };
  Batch unsent(const std::string& fleet, const RecordKind& kind, std::size_t limit) const;  ///< oldest first
  std::size_t unsentCount(const std::string& fleet) const;                                  ///< of all kinds
  /// All up to this number.
  void markSent(const std::string& fleet, const RecordKind& kind, std::int64_t last);
  /// The fleet that was handed on to last, by its identity; empty: none yet.
  std::string lastFleet() const;
  /// Records that came from the fleet are not to be handed back. @return how many were new.
  std::size_t addFrom(const std::string& fleet, const RecordKind& kind, const std::vector<Row>& rows);
  std::vector<std::string> identities(const RecordKind& kind) const;
  /// @}

 private:
  std::size_t add(const RecordKind& kind, const std::vector<Row>& rows);
  std::vector<Row> rows(const RecordKind& kind) const;
  std::size_t unsentCount(const std::string& fleet, const RecordKind& kind) const;
  std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct FoundCoefficients {
  std::optional<CoefficientSet> set;
  std::string message;  ///< one line: where they come from, or what is known instead
};

/// Answer to the service: the newest of the pair; else, in the same material, what other tools gave, with its
/// uncertainty widened. @throws Error when the database cannot be read.
FoundCoefficients findCoefficients(const CoefficientDatabase& database, const std::string& tool,
                                   const std::string& material);

/// @{ All records as CSV (one header row, name[unit]) or YAML (smartmill-coefficients/1); 17 digits, so that
/// export and import lose nothing. @throws Error naming file, line or key, and value.
void exportCsv(const std::vector<CoefficientRecord>& records, const std::string& file);
std::vector<CoefficientRecord> importCsv(const std::string& file);
void exportYaml(const std::vector<CoefficientRecord>& records, const std::string& file);
std::vector<CoefficientRecord> importYaml(const std::string& file);
/// @}

}  // namespace smartmill::loadmeter
